"""A participant by Eclipse Cyclone DDS, without any ROS: receives states and commands, and steers.

Prints what it has received since the first command, and how far the joints have moved, as JSON:
python test/other_dds.py DOMAIN STATES
"""

import json
import os
import sys
import time
from typing import Any

# On this host, and to participants that do not use multicast.
os.environ['CYCLONEDDS_URI'] = """
<CycloneDDS><Domain>
  <General>
    <Interfaces><NetworkInterface address="127.0.0.1"/></Interfaces>
    <AllowMulticast>false</AllowMulticast>
  </General>
  <Discovery>
    <ParticipantIndex>auto</ParticipantIndex>
    <MaxAutoParticipantIndex>32</MaxAutoParticipantIndex>
    <Peers><Peer address="127.0.0.1"/></Peers>
  </Discovery>
</Domain></CycloneDDS>
"""

from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct, make_idl_struct, types
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic


def message(package: str, kind: str, /, **fields: Any) -> type[IdlStruct]:
    """A message as ROS names it on the wire."""
    return make_idl_struct(kind, f'{package}::msg::dds_::{kind}_', fields)


NUMBERS = types.sequence[types.float64]
Time = message('builtin_interfaces', 'Time', sec=types.int32, nanosec=types.uint32)
Header = message('std_msgs', 'Header', stamp=Time, frame_id=str)
JointState = message(
    'sensor_msgs',
    'JointState',
    header=Header,
    name=types.sequence[str],
    position=NUMBERS,
    velocity=NUMBERS,
    effort=NUMBERS,
)
Vector3 = message('geometry_msgs', 'Vector3', x=types.float64, y=types.float64, z=types.float64)
Twist = message('geometry_msgs', 'Twist', linear=Vector3, angular=Vector3)
TwistStamped = message('geometry_msgs', 'TwistStamped', header=Header, twist=Twist)

RELIABLE = Qos(Policy.Reliability.Reliable(0), Policy.History.KeepLast(1000))
SLOW = Twist(linear=Vector3(x=0.0, y=-0.05, z=0.0), angular=Vector3(x=0.0, y=0.0, z=0.0))  # [m/s]


def main(domain: int, wanted: int) -> None:
    participant = DomainParticipant(domain)

    def topic(name: str, kind: type[IdlStruct]) -> Topic:
        return Topic(participant, f'rt/{name}', kind)

    states = DataReader(participant, topic('joint_states', JointState), RELIABLE)
    commands = DataReader(participant, topic('joint_command', JointState), RELIABLE)
    twists = DataWriter(participant, topic('cartesian_velocity', TwistStamped), RELIABLE)
    asked: dict[tuple[int, int], Any] = {}
    returned: dict[tuple[int, int], Any] = {}
    while len(asked) < wanted:
        received = by_stamp(states)
        returned |= by_stamp(commands)
        if returned:  # how long the controller takes to come does not matter
            asked |= received
        now = Header(stamp=Time(sec=0, nanosec=0), frame_id='')  # a zero stamp means now
        twists.write(TwistStamped(header=now, twist=SLOW))
        time.sleep(0.01)
    returned |= by_stamp(commands)
    first, *_, last = asked.values()
    found = {
        'returned': len(asked.keys() & returned.keys()),
        'joints': list(first.name),
        'moved': max(abs(b - a) for a, b in zip(first.position, last.position, strict=True)),
        'ros': 'rclpy' in sys.modules,
    }
    print(json.dumps(found))


def by_stamp(reader: DataReader) -> dict[tuple[int, int], Any]:
    return {(m.header.stamp.sec, m.header.stamp.nanosec): m for m in reader.take(100)}


if __name__ == '__main__':
    main(int(sys.argv[1]), int(sys.argv[2]))
