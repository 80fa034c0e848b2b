"""Grasps for tests: from the reference files, and at random."""

import numpy as np

from apprehend.grasp import Contact, ContactModel, Grasp

MODELS = {
    "hard": ContactModel.COULOMB,
    "frictionless": ContactModel.FRICTIONLESS,
    "soft_mls": ContactModel.SOFT_BOX,
    "soft_elliptic": ContactModel.SOFT,
}


def contact(row):
    """A contact of a reference file."""
    return Contact(
        np.array(row["p"]), np.array(row["n"]), row["mu"], MODELS[row["model"]], row.get("gamma") or 0.0,
        np.array(row["t1"]),
    )  # fmt: skip


def random_grasp(rng, k, model=ContactModel.COULOMB, friction=0.6, torsion=0.1, spread=0.25):
    """Contacts on a unit sphere whose normals point inwards, more or less."""
    points = rng.normal(size=(k, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    normals = -points + spread * rng.normal(size=points.shape)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    models = [model] * k if isinstance(model, ContactModel) else model
    return Grasp([Contact(p, n, friction, m, torsion) for p, n, m in zip(points, normals, models, strict=True)])


def random_force(rng, contact):
    """A force strictly inside the cone of a contact, with unit normal force."""
    f = np.zeros(contact.size)
    f[0 if contact.size == 1 else 2] = 1.0
    if contact.size >= 3:
        direction = rng.normal(size=3 if contact.size == 4 else 2)
        direction *= 0.99 * rng.random() / np.linalg.norm(direction)
        f[:2] = contact.friction * direction[:2]
        if contact.size == 4:
            f[3] = contact.torsion * direction[2]
    return f
