"""Grasps: contacts, closure and quality, contact forces, and planning on meshes."""

from .candidates import Candidate, GraspPlan, HandCandidate, PlanStatus
from .closure import Closure, ClosureStatus
from .closures import Closures, closed, force_closures
from .contact import Contact, ContactModel
from .files import read_grasp
from .force_batch import optimal_forces
from .forces import ContactForces, ForceBatch, ForceStatus
from .grasp import Grasp
from .hand_grasp import HandGrasp, hand_jacobian
from .immobility import Immobility, ImmobilityStatus
from .limits import Limits
from .patch import Patch
from .picture import save_picture
from .plans import plan
from .push import Push
from .quality import Quality
from .surface import Surface

__all__ = [
    "Candidate",
    "Closure",
    "ClosureStatus",
    "Closures",
    "Contact",
    "ContactForces",
    "ContactModel",
    "ForceBatch",
    "ForceStatus",
    "Grasp",
    "GraspPlan",
    "HandCandidate",
    "HandGrasp",
    "Immobility",
    "ImmobilityStatus",
    "Limits",
    "Patch",
    "PlanStatus",
    "Push",
    "Quality",
    "Surface",
    "closed",
    "force_closures",
    "hand_jacobian",
    "optimal_forces",
    "plan",
    "read_grasp",
    "save_picture",
]
