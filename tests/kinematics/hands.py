"""Hands made of boxes, written as URDF, whose measures are known."""

from __future__ import annotations

import math

from apprehend.kinematics import Hand, Robot
from apprehend.robots import parse_urdf


def box(size: str, xyz: str, rpy: str = "0 0 0") -> str:
    return f'<collision><origin xyz="{xyz}" rpy="{rpy}"/><geometry><box size="{size}"/></geometry></collision>'


def sliding(
    *, gap: float = 0.06, mimic: bool = True, axis: str = "0 1 0", turn: str = "0 0 0", effort: float = 30.0
) -> Hand:
    """Two fingers 0.1 m long that slide along *axis*: pads 20 mm wide, from z = 0.08 to 0.1, *gap* when open.

    The palm is a box whose top is at z = 0.03.
    """
    half = 0.5 * gap
    finger = box("0.02 0.01 0.07", "0 {side}0.015 0.065") + box("0.02 0.01 0.02", "0 {side}0.005 0.09")
    left, right = finger.format(side=""), finger.format(side="-")
    follow = '<mimic joint="left" multiplier="1"/>' if mimic else ""
    return Hand(
        Robot(
            parse_urdf(
                f"""<robot name="slider"><link name="base"/>
<link name="palm">{box("0.05 0.15 0.03", "0 0 0.015")}</link>
<link name="a">{left}</link><link name="b">{right}</link>
<joint name="mount" type="fixed"><origin rpy="{turn}"/><parent link="base"/><child link="palm"/></joint>
<joint name="left" type="prismatic"><parent link="palm"/><child link="a"/><axis xyz="{axis}"/>
<limit lower="0" upper="{half}" effort="{effort}" velocity="1"/></joint>
<joint name="right" type="prismatic"><parent link="palm"/><child link="b"/><axis xyz="{axis}"/>
<origin rpy="0 0 0"/><limit lower="{-half}" upper="0" effort="{effort}" velocity="1"/>{follow.replace('"1"', '"-1"')}
</joint></robot>"""
            )
        )
    )


def hinged(length: float = 0.1) -> Hand:
    """One jaw that turns about y at the origin against a standing one; both reach *length* along z, pads of 20 mm."""
    pad = length - 0.01
    still = box("0.02 0.03 0.02", f"-0.01 0 {pad}") + box("0.005 0.03 0.08", "-0.0175 0 0.04")
    turning = box("0.02 0.03 0.02", f"0.01 0 {pad}") + box("0.005 0.03 0.08", "0.0175 0 0.04")
    hub = box("0.04 0.03 0.02", "0 0 0")
    return Hand(
        Robot(
            parse_urdf(
                f"""<robot name="pliers">
<link name="fixed_jaw">{still}{hub}</link><link name="jaw">{turning}{hub}</link>
<joint name="hinge" type="revolute"><parent link="fixed_jaw"/><child link="jaw"/><axis xyz="0 1 0"/>
<limit lower="0" upper="{math.radians(100)}" effort="2" velocity="1"/></joint></robot>"""
            )
        )
    )
