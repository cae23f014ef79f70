"""Contact: impedance and force through a position interface, and reactions to faults.

The pure part: no ROS, usable beside a Controller in any closed loop.
"""

from redres_ros.contact.admittance import BASE, TIP, Admittance, AdmittanceSettings
from redres_ros.contact.contact_control import ContactControl, ContactError, TareError

__all__ = [
    'BASE',
    'TIP',
    'Admittance',
    'AdmittanceSettings',
    'ContactControl',
    'ContactError',
    'TareError',
]
