"""Grasps: contacts, closure and quality, contact forces, and planning on meshes."""

from .candidates import Candidate, GraspPlan, PlanStatus
from .contact import Contact, ContactModel
from .jaw_plan import plan
from .surface import Surface

__all__ = ["Candidate", "Contact", "ContactModel", "GraspPlan", "PlanStatus", "Surface", "plan"]
