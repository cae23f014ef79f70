"""Contact: impedance and force through a position interface, and reactions to faults.

The pure part: no ROS, usable beside a Controller in any closed loop.
"""

from redres_ros.contact.admittance import Admittance
from redres_ros.contact.contact_control import ContactControl
from redres_ros.contact.settings import AdmittanceSettings, minimum_damping

__all__ = ['Admittance', 'AdmittanceSettings', 'ContactControl', 'minimum_damping']
