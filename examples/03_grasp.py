"""Plan grasps of a mug, prove that the best one closes, and compute the contact forces that lift it."""

import numpy as np

import apprehend as ap

mug = ap.Body.household("mug")
hand = ap.Hand.load("robotiq_2f_85")
best = ap.grasp.plan(hand, mug, n=10, rng=np.random.default_rng(0)).require_success()[0]
print(f"{best.width * 1e3:.0f} mm wide, needs {best.required_force:.1f} N at each pad")

grasp = ap.Grasp(best.contacts, body=mug)
closure = grasp.force_closure()
print(closure.explain())
assert closure.success
assert np.abs(grasp.matrix @ closure.internal_force).max() < 1e-9  # the proof: forces inside the cones that cancel

weight = np.array([0.0, 0.0, -mug.mass * 9.81, 0.0, 0.0, 0.0])  # gravity on the mug, at its centre of mass
forces = grasp.contact_forces(weight, objective="min_normal").require_success()
print(forces.explain())
assert np.abs(grasp.matrix @ forces.forces + weight).max() < 1e-6
