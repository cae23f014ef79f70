"""The life cycle of ROS 2: its states, by its standard services."""

from typing import Any

from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from redres_ros.errors import RedresError
from redres_ros.nodes.parameters import check_given, declare_one
from redres_ros.nodes.topics import STEADY
from redres_ros.parameter import Parameter

_DONE = TransitionCallbackReturn.SUCCESS
_PATIENCE = 3.0  # [s] for the first message on /clock
_INITIAL_STATE = Parameter(
    'state of its life cycle in which the node starts',
    choices=('unconfigured', 'inactive', 'active'),
)


class LifeError(RedresError):
    """An action that needs an active node."""


class ManagedNode(LifecycleNode):
    """A node with a life cycle, by default active from the start.

    A subclass says with `_begin`, `_end` and `_forget` what a change means to it, and calls
    `_start_life` when it is ready for the first one.

    Attributes:
        configured: Whether it listens: inactive or active.
        active: Whether it also acts: sends what others act on.
    """

    configured = False
    active = False

    def __init__(self, name: str) -> None:
        """A node of that name. Raises RedresError if it was remapped, or a parameter is gone."""
        super().__init__(name)
        if self.get_name() != name:
            raise LifeError(
                f'__node is {self.get_name()!r}; allowed: {name}, which is part of the topics that '
                f'other nodes use; a namespace keeps robots apart: -r __ns:=/{self.get_name()}'
            )
        check_given(self)

    def _start_life(self) -> None:
        """Go to the state in which the node is to start."""
        self._refuse_impossible_transitions()
        if self.get_parameter('use_sim_time').value:
            self._clock_timer = self.create_timer(_PATIENCE, self._look_at_clock, clock=STEADY)
        wanted = declare_one(self, 'initial_state', 'active', _INITIAL_STATE)
        if wanted != 'unconfigured':
            self.trigger_configure()
        if wanted == 'active':
            self.trigger_activate()

    def _look_at_clock(self) -> None:
        """Report once that use_sim_time is set but /clock is not published."""
        self._clock_timer.cancel()
        if self.get_clock().now().nanoseconds == 0:
            self.get_logger().warning(
                'use_sim_time is true, but /clock has no publisher: what this node itself stamps '
                'has the time 0; start the simulation, or set use_sim_time to false'
            )

    def _begin(self) -> None: ...

    def _end(self) -> None: ...

    def _forget(self) -> None: ...

    def _may_be_cleaned_up(self) -> bool:
        """Whether nothing moves any more."""
        return True

    @property
    def life(self) -> str:
        """Its state in the life cycle: unconfigured, inactive, active or finalized."""
        return str(self._state_machine.current_state[1])

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Listen."""
        self.configured = True
        return _DONE

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begin to act."""
        self._begin()
        self.active = True
        return _DONE

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Stop acting."""
        self.active = False
        self._end()
        return _DONE

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Reset, and stop listening; refused while something is still moving."""
        if not self._may_be_cleaned_up():
            self.get_logger().warning('cleanup refused: the arm is still coming to rest')
            return TransitionCallbackReturn.FAILURE
        self.configured = False
        self._forget()
        return _DONE

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Never act again; a motion decelerates to rest, as in on_deactivate."""
        return self.on_deactivate(state) if self.active else _DONE

    def _refuse_impossible_transitions(self) -> None:
        """Reject a transition that the state does not allow; rclpy 7.1 would end the node."""
        service = self._service_change_state
        change_state = service.callback

        def respond(request: Any, response: Any) -> Any:
            wanted = request.transition
            possible = [(each[0], each[1]) for each in self._state_machine.available_transitions]
            by_label = any(label == wanted.label for _, label in possible)
            by_number = any(number == wanted.id for number, _ in possible)
            if by_label if wanted.label else by_number:
                return change_state(request, response)
            response.success = False
            return response

        service.callback = respond
