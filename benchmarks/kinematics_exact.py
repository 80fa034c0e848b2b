"""exp(log R) over 10,000 axes and hard angles: largest entry of the difference, ours and SciPy's.

python -m benchmarks.kinematics_exact
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation as Peer

from apprehend.spatial import Pose, euler, se3, so3


def main() -> None:
    rng = np.random.default_rng(0)
    w = rng.normal(size=(10_000, 3))
    w /= np.linalg.norm(w, axis=1, keepdims=True)
    near = [np.pi - 10.0**-k for k in range(2, 13)]
    angles = [np.pi, *near, 0.0, 1e-300, 1e-100, 1e-20, 1e-9, 1e-6, 1e-3, *np.linspace(0.01, np.pi, 200)]
    ours = theirs = motions = screws = 0.0
    for angle in angles:
        R = so3.exp(angle * w)
        ours = max(ours, float(np.abs(so3.exp(so3.log(R)) - R).max()))
        again = Peer.from_rotvec(Peer.from_matrix(R).as_rotvec()).as_matrix()
        theirs = max(theirs, float(np.abs(again - R).max()))
        for size in (1.0, 1e3):
            T = se3.exp(np.hstack([size * rng.normal(size=w.shape), angle * w]))
            motions = max(motions, difference(se3.exp(se3.log(T)), T))
            screws = max(screws, difference(Pose(T).screw().motion().matrix, T))
    print(f"  exp(log R):                       {ours:.1e}   (SciPy {theirs:.1e})")
    print(f"  exp(log T), translations to 1e3:  {motions:.1e}   relative to their size")
    print(f"  screws of these motions, back:    {screws:.1e}")
    worst = peer = 0.0
    for sequence in euler.SEQUENCES:
        lock = 0.0 if sequence[0] == sequence[2] else np.pi / 2
        middle = np.concatenate([[lock], lock + 10.0 ** -rng.uniform(1, 16, 4999), rng.uniform(0, np.pi, 5000)])
        a = np.column_stack([rng.uniform(-np.pi, np.pi, 10_000), middle, rng.uniform(-np.pi, np.pi, 10_000)])
        R = euler.to_matrix(a, sequence, "intrinsic")
        again = euler.to_matrix(euler.from_matrix(R, sequence, "intrinsic"), sequence, "intrinsic")
        worst = max(worst, float(np.abs(again - R).max()))
        upper = sequence.upper()
        angles_of_peer = _quiet_euler(Peer.from_matrix(R), upper)
        peer = max(peer, float(np.abs(Peer.from_euler(upper, angles_of_peer).as_matrix() - R).max()))
    print(f"  Euler angles near gimbal lock:    {worst:.1e}   (SciPy {peer:.1e})")


def difference(again: np.ndarray, T: np.ndarray) -> float:
    """Largest entry of the difference, that of translations relative to the largest one."""
    error = np.abs(again - T)
    scale = max(1.0, float(np.abs(T[:, :3, 3]).max()))
    return max(float(error[:, :3, :3].max()), float(error[:, :3, 3].max()) / scale)


def _quiet_euler(rotation: Peer, sequence: str) -> np.ndarray:
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return np.asarray(rotation.as_euler(sequence))


if __name__ == "__main__":
    main()
