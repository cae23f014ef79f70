"""A participant by Eclipse Cyclone DDS, without any ROS: receives states and commands, and steers.

Prints what it has received since the first command, and how far the joints have moved, as JSON:
python test/other_dds.py DOMAIN STATES
"""

import json
import os
import sys
import time
from dataclasses import dataclass

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
from cyclonedds.idl import IdlStruct, types
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic


# As ROS names them on the wire.
@dataclass
class Time(IdlStruct, typename='builtin_interfaces::msg::dds_::Time_'):
    sec: types.int32
    nanosec: types.uint32


@dataclass
class Header(IdlStruct, typename='std_msgs::msg::dds_::Header_'):
    stamp: Time
    frame_id: str


@dataclass
class JointState(IdlStruct, typename='sensor_msgs::msg::dds_::JointState_'):
    header: Header
    name: types.sequence[str]
    position: types.sequence[types.float64]
    velocity: types.sequence[types.float64]
    effort: types.sequence[types.float64]


@dataclass
class Vector3(IdlStruct, typename='geometry_msgs::msg::dds_::Vector3_'):
    x: types.float64
    y: types.float64
    z: types.float64


@dataclass
class Twist(IdlStruct, typename='geometry_msgs::msg::dds_::Twist_'):
    linear: Vector3
    angular: Vector3


@dataclass
class TwistStamped(IdlStruct, typename='geometry_msgs::msg::dds_::TwistStamped_'):
    header: Header
    twist: Twist


RELIABLE = Qos(Policy.Reliability.Reliable(0), Policy.History.KeepLast(1000))
SLOW = Twist(Vector3(0.0, -0.05, 0.0), Vector3(0.0, 0.0, 0.0))  # [m/s]


Received = dict[tuple[int, int], JointState]  # by their stamps


def main(domain: int, wanted: int) -> None:
    participant = DomainParticipant(domain)
    states = DataReader(participant, Topic(participant, 'rt/joint_states', JointState), RELIABLE)
    commands = DataReader(participant, Topic(participant, 'rt/joint_command', JointState), RELIABLE)
    twists = DataWriter(
        participant, Topic(participant, 'rt/cartesian_velocity', TwistStamped), RELIABLE
    )
    asked: Received = {}
    returned: Received = {}
    while len(asked) < wanted:
        received = by_stamp(states)
        returned |= by_stamp(commands)
        if returned:  # how long the controller takes to come does not matter
            asked |= received
        # A zero stamp means now.
        twists.write(TwistStamped(Header(Time(0, 0), ''), SLOW))
        time.sleep(0.01)
    returned |= by_stamp(commands)
    first, *_, last = asked.values()
    ways = [abs(b - a) for a, b in zip(first.position, last.position, strict=True)]
    print(
        json.dumps(
            {
                'states': len(asked),
                'returned': len(asked.keys() & returned.keys()),
                'joints': list(first.name),
                'moved': max(ways),
                'ros': 'rclpy' in sys.modules,
            }
        )
    )


def by_stamp(reader: DataReader[JointState]) -> Received:
    return {(m.header.stamp.sec, m.header.stamp.nanosec): m for m in reader.take(100)}


if __name__ == '__main__':
    main(int(sys.argv[1]), int(sys.argv[2]))
