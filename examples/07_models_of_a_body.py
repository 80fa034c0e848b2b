"""One body in many models: boxes, spheres, capsules, voxels, a wireframe, a section, and a signed distance field."""

import numpy as np

import apprehend as ap

mug = ap.Body.household("mug")
for name in ("boxes", "spheres", "capsules", "voxels", "wireframe"):
    model = mug.model(name)
    print(f"{name:10} {mug.deviation(model)}")  # what is lost: bounds that hold

spheres = mug.spheres(40)
points, _, _ = mug.sample_surface(1000, np.random.default_rng(0))
assert spheres.inside(points).all()  # nothing of the mug sticks out

section = mug.section(normal=[0.0, 1.0, 0.0])
print(f"section: {1e4 * section.area:.1f} cm² in {len(section)} polygons")

field = mug.distance_field(resolution=0.003)
asked = np.random.default_rng(1).uniform(field.origin, field.upper, (100_000, 3))
error = np.abs(field.distance(asked[:2000]) - mug.signed_distance(asked[:2000]))
print(f"{field.values.size} grid points; error {1e3 * error.max():.2f} mm, at most {1e3 * field.error:.2f} mm promised")
assert error.max() <= field.error
distance, gradient = field.distance_and_gradient(asked)
assert distance.shape == (100_000,)
assert gradient.shape == (100_000, 3)
