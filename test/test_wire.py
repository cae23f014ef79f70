"""Messages read in place hold what rclpy reads."""

import random
import string
import struct
from contextlib import suppress

import numpy as np
import pytest
from geometry_msgs.msg import TwistStamped
from graph_helpers import to_joint_state
from messages import to_twist
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import JointState

from redres_ros.nodes.conversions import (
    EncodingError,
    JointStateReader,
    JointStateWriter,
    TwistWriter,
    read_twist,
)

NAMES = tuple(f'joint_{i}' for i in range(7))
Q = np.linspace(-1.0, 1.0, 7)


def random_text(rng: random.Random) -> str:
    return ''.join(rng.choices(string.ascii_letters + '_/ü', k=rng.randrange(20)))


def random_state(rng: random.Random) -> JointState:
    count = rng.randrange(10)
    state = JointState()
    state.header.stamp.sec = rng.randrange(-(2**31), 2**31)
    state.header.stamp.nanosec = rng.randrange(10**9)
    state.header.frame_id = random_text(rng)
    state.name = [random_text(rng) for _ in range(count)]
    state.position = [rng.gauss(0.0, 1.0) for _ in range(rng.choice((count, count, count + 1, 0)))]
    state.velocity = [rng.gauss(0.0, 1.0) for _ in range(rng.choice((count, 0)))]
    return state


def stamp(message: JointState | TwistStamped) -> int:
    return message.header.stamp.sec * 10**9 + message.header.stamp.nanosec


def test_states_are_read_as_rclpy_reads_them():
    rng = random.Random(0)
    reader = JointStateReader()
    states = [random_state(rng) for _ in range(300)]
    for state in [*states, *states]:  # the second time most of them have been seen
        for message in (serialize_message(state), state):
            sample = reader.read(message)
            assert sample.stamp == stamp(state)
            assert list(sample.name) == list(state.name)
            assert list(sample.position) == list(state.position)


@pytest.mark.parametrize('nanoseconds', [10**9, 2**32 - 1])
def test_a_stamp_that_no_command_could_carry_is_refused(nanoseconds: int):
    reader = JointStateReader()
    state = to_joint_state(0, NAMES, Q, Q)
    twist = to_twist(0, 'world', np.zeros(6))
    reader.read(serialize_message(state))  # the next one is read in place
    for message in (state, twist):
        message.header.stamp.sec = 2**31 - 1
        message.header.stamp.nanosec = nanoseconds
        read = reader.read if message is state else read_twist
        for given in (message, serialize_message(message)):
            with pytest.raises(EncodingError, match=f'{nanoseconds} ns in nanosec'):
                read(given)


def test_the_next_state_of_a_device_is_read_in_place():
    reader = JointStateReader()
    for k in range(3):
        sample = reader.read(serialize_message(to_joint_state(10**9 + k, NAMES, k * Q, Q)))
        assert sample.stamp == 10**9 + k
        assert (np.array(sample.position) == k * Q).all()
        assert isinstance(sample.position, np.ndarray) == (k > 0)


def test_twists_are_read_as_rclpy_reads_them():
    rng = np.random.default_rng(1)
    for _ in range(200):
        stamped = int(rng.integers(-(2**31), 2**31)) * 10**9 + int(rng.integers(10**9))
        twist = to_twist(stamped, random_text(random.Random(stamped)), rng.normal(size=6))
        for message in (serialize_message(twist), twist):
            got, frame, dx = read_twist(message)
            assert (got, frame) == (stamped, twist.header.frame_id)
            assert (dx == (*xyz(twist.twist.linear), *xyz(twist.twist.angular))).all()


def xyz(vector) -> tuple[float, float, float]:
    return vector.x, vector.y, vector.z


def big_endian(twist: TwistStamped) -> bytes:
    frame = twist.header.frame_id.encode() + b'\x00'
    head = struct.pack('>4siII', b'\x00\x00\x00\x00', 1, 2, len(frame)) + frame
    head += bytes((4 - len(head)) % 8)
    return head + struct.pack('>6d', *xyz(twist.twist.linear), *xyz(twist.twist.angular))


def test_another_byte_order_is_left_to_rclpy():
    twist = to_twist(1, 'world', np.arange(6.0))
    data = big_endian(twist)
    assert deserialize_message(data, TwistStamped).twist == twist.twist
    assert (read_twist(data)[2] == np.arange(6.0)).all()


@pytest.mark.parametrize('length', [0, 3, 4, 11, 15, 40, 100, 150])
def test_states_that_end_too_early_are_refused(length):
    reader = JointStateReader()
    whole = serialize_message(to_joint_state(10**9, NAMES, Q, Q))
    for _ in range(2):  # before and after its layout is known
        with pytest.raises(EncodingError):
            reader.read(whole[:length])
        reader.read(whole)


@pytest.mark.parametrize('length', [0, 3, 4, 11, 15, 40, 70])
def test_twists_that_end_too_early_are_refused(length):
    with pytest.raises(EncodingError):
        read_twist(serialize_message(to_twist(10**9, 'world', np.arange(6.0)))[:length])


def test_a_text_that_claims_to_be_longer_than_the_message_is_refused():
    data = bytearray(serialize_message(to_twist(10**9, 'world', np.arange(6.0))))
    for length in (100, 2**31, 2**32 - 1):
        struct.pack_into('<I', data, 12, length)
        with pytest.raises(EncodingError):
            read_twist(bytes(data))


def test_random_bytes_are_refused_or_read_and_nothing_else():
    rng = random.Random(2)
    reader = JointStateReader()
    whole = serialize_message(to_joint_state(10**9, NAMES, Q, Q))
    reader.read(whole)
    for _ in range(300):
        data = bytearray(whole)
        for _ in range(rng.randrange(1, 8)):
            data[rng.randrange(len(data))] = rng.randrange(256)
        for read in (reader.read, read_twist):
            with suppress(EncodingError):
                read(bytes(data[: rng.randrange(len(data) + 1)]))


def test_states_and_twists_are_written_as_rclpy_writes_them():
    rng = random.Random(2)
    numbers = np.random.default_rng(2)
    for _ in range(100):
        n = rng.randrange(1, 10)
        names = [random_text(rng) for _ in range(n)]
        frame = random_text(rng)
        states = JointStateWriter(names)
        twists = TwistWriter(frame)
        for _ in range(3):
            stamped = rng.randrange(2**31 * 10**9)
            q, dq = numbers.normal(size=(2, n))
            dx = numbers.normal(size=rng.choice((3, 6)))
            state = to_joint_state(stamped, names, q, dq)
            written = states.written(stamped, q, dq)
            assert deserialize_message(written, JointState) == state
            assert len(written) == len(serialize_message(state))
            twist = twists.written(stamped, dx)
            assert deserialize_message(twist, TwistStamped) == to_twist(stamped, frame, dx)
