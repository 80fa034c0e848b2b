"""The whole process in physics, from seeing the object to letting go of it."""

import apprehend as ap
from apprehend.process import pick_and_place, shuffled

scene = shuffled(ap.Scene.tabletop("ur5e", body="bottle"), seed=2)
episode = pick_and_place(scene, seed=2)
for step in episode.steps:
    print(f"{step.title:24} {step.message}")
print(episode.verdict.reason)
assert episode.success
