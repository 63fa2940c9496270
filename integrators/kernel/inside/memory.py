"""What a search for events keeps in memory, by name; see `integrators.kernel.native.memory`."""

from integrators.kernel.native.memory import Array, Backward, Integer, Memory, Pointer, Pointers, Real

FINE = 8  # points between two samples of a function where its zeros are looked for
FINEST = 256  # samples in a step, or in a part of one, that are not exceeded
POINTS = FINE * FINEST + 1
ROOM = 3 * POINTS  # for marks and zeros, of which a point has three at most
TINY = 2.0**-1000  # a sign without a size
NOTED = 2  # `Search.due` of an event that has happened at this time, and does not again
CACHED = 32  # states of a step that are remembered
NODES = 8  # of Gauss's quadrature, for a gamma_s that stages do not tell; see `series`

# What is looked at: the step that is solved, what of it there is up to a time, the start alone.
WHOLE, PART, START = range(3)
# Why a look has come back without success.
GOING, TERMINAL, FULL, UNRESOLVED, RAISED, UNSOLVABLE, UNDEFINED = range(7)


class Search(Memory):
    """The events of a trajectory: their functions, what of them is known, and work space for one step.

    A *point* is a part of the stretch of time that is looked at, 0 at its start and 1 at its end.
    """

    # --- what is looked for ---
    count = Integer()  # events
    functions = Pointers()  # void(times, states, par, values), on eight states
    directions = Array("count", kind=int)  # 1, -1, or 0 for all
    actions = Pointers()  # functions like those, that make a new state; 0: none
    last = Real()  # the time up to which is looked, where some do
    sign = Real()  # of the direction of time
    limits = Array("count", kind=int)  # the occurrence that ends the integration; 0: none
    dim = Integer()
    parameters = Integer()
    terms = Integer()  # of the polynomial on which is looked
    groups = Integer()  # of eight of them
    series = Array(8, "dim", "groups")  # their coefficients
    gauss = Array(16)  # eight nodes, and the weights there of the term that the step has not
    node_times = Array(16)
    chunks = Integer()  # of eight first samples
    degree = Integer()  # of the polynomials through the first samples; a power of 2
    steps = Pointer()  # the compiled steps, for partial ones
    own = Backward()  # the trajectory's context
    partial = Pointer()  # that for partial steps
    # Length of the partial step, and of the last one from the same state, or 0 if there was none
    part = Array(2)
    cosines = Array()  # of the angles pi i / (FINE FINEST)
    transforms = Pointers()  # tables, samples -> coefficients, by an eighth of the degree
    first_weights = Array(16, "terms", "chunks")  # `weights` at the first samples of a whole step

    # --- what lasts from step to step ---
    ends = Array("count")  # values of the functions at the present state
    touched = Array("count")  # when each was last seen to be zero
    finite = Array("count", kind=int)  # 1: the function was finite somewhere
    happened = Array("count", kind=int)
    recent = Array("count", 3)  # when each has changed the state last, before that, and before that
    known = Real()  # the time up to which all is known
    evaluations = Integer()  # of the field, for partial steps
    iterations = Integer()
    partial_steps = Integer()

    # --- what has happened; arrays that the owner empties, and makes larger; see `search.Log` ---
    room = Integer()
    hits = Integer()
    first = Integer()  # the first of this look
    member = Integer()  # of which trajectory, where there are many
    hit_members = Array(kind=int)
    hit_times = Array()
    hit_states = Array()
    hit_after = Array()  # states that the events' actions have made of these
    hit_par = Array()  # parameters from then on
    hit_events = Array(kind=int)
    hit_directions = Array(kind=int)

    # --- events that change the state, or end it all, at the end of the step; see `inside.actions` ---
    due = Array("count", kind=int)  # 1: it happens there; `NOTED`: it has, and changes nothing
    due_directions = Array("count", kind=int)
    values_before = Array("count")  # of the functions, before the state is changed
    action_state = Array("dim")  # at the first event that ends the step
    new_state = Array("dim")
    new_par = Array("parameters")
    # A new state and parameters, in columns; the first of the last row: 1 where making them has raised.
    action_outputs = Array("made_rows", 8)
    made_rows = Integer()

    # --- how it stands ---
    mode = Integer()  # WHOLE, PART or START
    goal = Real()  # the time up to which a PART is looked at
    halted = Integer()  # GOING, or why not
    event = Integer()  # that is being looked for
    raised = Integer()  # 1 + the event whose function has raised, or 0
    touched_before = Array("count")  # `touched` at the start of the step

    # --- the step, and the stretch of it that is looked at ---
    time = Real()  # of the present state: a sum of two
    time_low = Real()
    stop = Real()  # time of the end of what is looked at
    step_state = Array("dim")  # states at both
    stop_state = Array("dim")
    start = Real()  # times of the stretch
    end = Real()
    start_state = Array("dim")
    end_state = Array("dim")
    start_value = Real()
    end_value = Real()
    resolution = Real()  # part of the stretch that times can be told apart by
    sampled = Array("count", FINEST)  # values of each function at the first samples, but for the first
    errors = Array("count")  # what the last term makes of each, where the step itself has none like it
    times = Array(8)
    block = Array("dim", 8)  # states, one in a column
    outputs = Array(16)  # values of a function on a block; [8]: 1 where it has raised
    weights = Array(16, "terms")  # of the coefficients of the step's polynomial, at eight times
    values = Array(FINEST + 8)  # samples
    coefficients = Array(FINEST + 32)  # of Chebyshev polynomials
    # What the coefficients that follow add up to at a corner, where the j-th is like 1/j^2
    truncation = Real()
    fitted = Integer()  # degree of the polynomial that is known at points; 0: samples are
    n = Integer()  # points where something is known
    points = Array(POINTS)
    fine = Array(POINTS)  # values of the polynomial there, or samples
    scale = Real()  # the largest of them
    lows = Array(POINTS, kind=int)
    low_count = Integer()
    marks = Array(ROOM)  # points where the sign of the function is known
    mark_signs = Array(ROOM, kind=int)
    mark_count = Integer()
    zeros = Array(ROOM)
    zero_directions = Array(ROOM, kind=int)
    zero_count = Integer()

    # --- states at ends of partial steps ---
    cache_times = Array(CACHED)
    cache_states = Array(CACHED, "dim")
    cache_next = Integer()
