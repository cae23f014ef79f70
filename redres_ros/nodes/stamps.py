"""Stamps of messages as nanoseconds, and back."""

from builtin_interfaces.msg import Time

from redres_ros.loop.cycle_counter import NANOSECONDS


def to_time(stamp: int) -> Time:
    """Nanoseconds to a stamp."""
    return Time(sec=stamp // NANOSECONDS, nanosec=stamp % NANOSECONDS)


def to_nanoseconds(stamp: Time) -> int:
    """A stamp to nanoseconds."""
    total: int = stamp.sec * NANOSECONDS + stamp.nanosec
    return total
