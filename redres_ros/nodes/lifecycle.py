"""The life cycle of ROS 2: its states, by its standard services."""

from collections.abc import Callable
from functools import partial
from typing import Any

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn

from redres_ros.nodes.parameters import ParameterError, check_given, declare_one
from redres_ros.parameter import Parameter

_Respond = Callable[[Any, Any], Any]

_DONE = TransitionCallbackReturn.SUCCESS
_INITIAL_STATE = Parameter(
    'state of its life cycle in which the node starts',
    choices=('unconfigured', 'inactive', 'active'),
)


class ManagedNode(LifecycleNode):
    """A node with a life cycle, by default active from the start.

    A subclass says with `_begin`, `_end` and `_forget` what a change means to it, and calls
    `_start_life` when it is ready for the first one.
    """

    def __init__(self, name: str) -> None:
        """A node of that name. Raises RedresError if it was remapped, or a parameter is gone."""
        super().__init__(name)
        if self.get_name() != name:
            raise ParameterError(
                f'__node is {self.get_name()!r}; allowed: {name}, which is part of the topics that '
                f'other nodes use; a namespace keeps robots apart: -r __ns:=/{self.get_name()}'
            )
        check_given(self)

    def _start_life(self) -> None:
        service = self._service_change_state
        service.callback = partial(self._change, service.callback)
        wanted = declare_one(self, 'initial_state', 'active', _INITIAL_STATE)
        if wanted != 'unconfigured':
            self.trigger_configure()
        if wanted == 'active':
            self.trigger_activate()

    def _begin(self) -> None: ...

    def _end(self) -> None: ...

    def _forget(self) -> bool:
        """Reset, if nothing moves any more; returns whether it does not."""
        return True

    @property
    def life(self) -> str:
        """Its state in the life cycle: unconfigured, inactive, active or finalized. In all but the
        first it listens: shut down it brings the arm to rest.
        """
        return str(self._state_machine.current_state[1])

    @property
    def active(self) -> bool:
        """Whether it acts: sends what others act on."""
        return self.life == 'active'

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._begin()
        return _DONE

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        self._end()
        return _DONE

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Reset, and stop listening; refused while something is still moving."""
        if self._forget():
            return _DONE
        self.get_logger().warning('cleanup refused: the arm is still coming to rest')
        return TransitionCallbackReturn.FAILURE

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Never act again; a motion decelerates to rest, as in on_deactivate."""
        return self.on_deactivate(state) if state.label == 'active' else _DONE

    def _change(self, respond: _Respond, request: Any, response: Any) -> Any:
        """Reject a transition that the state does not allow; rclpy 7.1 would end the node."""
        try:
            return respond(request, response)
        except rclpy_implementation.RCLError:
            response.success = False
            return response
