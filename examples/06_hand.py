"""Plan grasps for a hand with four fingers by both ways, and see what holds the object."""

import numpy as np

import apprehend as ap

mug = ap.Body.household("mug")
hand = ap.Hand.load("allegro_right")
plan = ap.grasp.plan(hand, mug, n=4, rng=np.random.default_rng(0)).require_success()
print(plan.explain())
best = plan[0]
assert isinstance(best, ap.grasp.HandCandidate)
print(f"{best.method}: {', '.join(best.links)} touch; ε ≥ {best.quality:.3f}")

grasp = best.grasp(mug)
assert np.abs(grasp.matrix @ best.internal_force).max() < 1e-9  # forces inside the cones that cancel: force closure

# what the fingers can do with it: motions they cannot follow, torques that hold its weight
J = ap.grasp.hand_jacobian(hand, best.q, grasp, best.links, np.linalg.inv(best.pose))
held = ap.grasp.HandGrasp(grasp, J)
for row in held.table():
    print(f"{row.property:22} {row.formula:16} {'yes' if row.holds else 'no':4} {row.dimension}")
weight = np.array([0.0, 0.0, -mug.mass * 9.81, 0.0, 0.0, 0.0])
found = grasp.contact_forces(weight, torque_limits=hand.robot.limits.effort, hand_jacobian=J).require_success()
torques = held.torques(found.forces)
assert (np.abs(torques) <= hand.robot.limits.effort + 1e-9).all()
print(f"largest torque: {np.abs(torques).max():.3f} N m")
