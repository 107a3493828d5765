"""Node ``managed_corrector``: the corrector with a lifecycle, for stacks that bring nodes up."""

import contextlib

from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.lifecycle import LifecycleNodeMixin, TransitionCallbackReturn

from frac_accel.errors import FracAccelError
from frac_accel.nodes._runtime import run_node
from frac_accel.nodes.corrector import Corrector


class ManagedCorrector(LifecycleNodeMixin, Corrector):
    """A `Corrector` whose states are those of ROS 2's managed nodes.

    ``configure`` loads the models and designs the filters; raw messages are then taken and
    filtered, so that the first output after ``activate`` needs no warm-up. Only an active one
    publishes corrected samples and metrics. ``cleanup`` leaves all topics and forgets the models.
    """

    def __init__(self, name="corrector", **options):
        Corrector.__init__(self, name, is_managed=True, **options)
        LifecycleNodeMixin.__init__(self)
        self._refuse_politely()

    def on_configure(self, state):
        """Load and design; stays unconfigured where that is not possible, and says why."""
        try:
            self.open()
        except FracAccelError as error:
            self.get_logger().error(f"cannot be configured: {error}")
            self.close()
            return TransitionCallbackReturn.FAILURE
        return TransitionCallbackReturn.SUCCESS

    def on_activate(self, state):
        """Publish from now on."""
        self.is_active = True
        return TransitionCallbackReturn.SUCCESS

    def on_deactivate(self, state):
        """Publish no more."""
        self.is_active = False
        return TransitionCallbackReturn.SUCCESS

    def on_cleanup(self, state):
        """Leave the topics."""
        self.finish()
        self.close()
        return TransitionCallbackReturn.SUCCESS

    def on_shutdown(self, state):
        """Correct what is waiting, and leave the topics."""
        self.on_cleanup(state)
        self.is_active, self.done = False, True
        return TransitionCallbackReturn.SUCCESS

    def on_error(self, state):
        """Begin anew, unconfigured."""
        self.is_active = False
        self.close()
        return TransitionCallbackReturn.SUCCESS

    def _refuse_politely(self):
        """Answer a transition that is not possible now with failure; rclpy would end the node."""
        service = self._service_change_state
        change = service.callback

        def callback(request, response):
            response.success = False
            with contextlib.suppress(rclpy_implementation.RCLError):
                return change(request, response)
            self.get_logger().warning(
                f"no transition '{request.transition.label or request.transition.id}' from the "
                f"state '{self._state_machine.current_state[1]}'")
            return response
        service.callback = callback


def main(arguments=None):
    """Entry point."""
    return run_node(ManagedCorrector, arguments)


if __name__ == "__main__":
    raise SystemExit(main())
