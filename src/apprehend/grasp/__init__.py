"""Grasps: contacts, closure and quality, contact forces, and planning on meshes."""

from .candidates import Candidate, GraspPlan, PlanStatus
from .closure import Closure, ClosureStatus, closed
from .contact import Contact, ContactModel
from .forces import ContactForces, ForceBatch, ForceStatus, Limits
from .grasp import Grasp
from .jaw_plan import plan
from .quality import Quality
from .surface import Surface

__all__ = [
    "Candidate", "Closure", "ClosureStatus", "Contact", "ContactForces", "ContactModel", "ForceBatch", "ForceStatus",
    "Grasp", "GraspPlan", "Limits", "PlanStatus", "Quality", "Surface", "closed", "plan",
]  # fmt: skip
