"""The arms: one URDF each, and a table of the data a URDF lacks."""

from redres_ros.robots.arm import Arm
from redres_ros.robots.from_urdf import arm_from_urdf
from redres_ros.robots.table import ARMS, choose_arm, find_arm

__all__ = ['ARMS', 'Arm', 'arm_from_urdf', 'choose_arm', 'find_arm']
