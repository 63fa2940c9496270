"""What a step knows of events."""

from integrators.kernel.native.memory import Integer, Part, Pointer, Real

# What the search for events is asked for at the end of a step that such an event ends: to CHANGE the state,
# and to BEGIN_ANEW from there.
CHANGE, BEGIN_ANEW = 1, 2


class Events(Part):
    """The search for events in each step, and the event that ends it; see `trajectory.act`."""

    code = Pointer()  # int64(context, memory), which looks for events in each step; 0: none
    memory = Pointer()
    act = Integer()  # 1: some of these change the state; then steps end there
    seen = Integer(lasting=True)  # 1: the solved step has been looked at
    # What an event that ends the solved step asks for: CHANGE, BEGIN_ANEW; 0: none does
    acting = Integer(lasting=True)
    time = Real(lasting=True)  # when
    length_before = Real(lasting=True)  # of the step before it was ended there
    acted = Real(lasting=True)  # when such an event happened last; infinite: never
    repeated = Integer(lasting=True)  # how many have happened at that time
