"""The memory of a group of trajectories, one in each lane, by name.

A row holds one number of every trajectory, side by side. Arrays of rows are declared with the
number of rows first; `lanes` is the length of a row.
"""

from integrators.kernel.native.memory import Array, Integer, Memory, Pointer, Pointers, Real

# How a trajectory has left its lane: to go by itself from its start, at its last time, where events
# accumulate, or, from BY_EVENT on, ended by the first event, the second, ...
LEFT, ARRIVED, ACCUMULATES, BY_EVENT = range(4)


class Group(Memory):
    """As many trajectories as a vector has lanes, their present step, and what is to be done with them."""

    # --- what is integrated, and how ---
    code = Pointer()  # void(group, count): see `ensemble.steps`
    lanes = Integer()
    rows = Integer()  # components of a stage: dof in second-order form, dim in first-order form
    dim = Integer()
    parameters = Integer()
    k = Integer()
    matrix = Array()  # values -> stages, (k, k) doubles row by row
    extrapolation = Array()  # the last step's values -> those of the step ahead, (k, k)
    nodes = Array()
    nodes_low = Array()
    weights = Array()
    weights_low = Array()
    position_weights = Array()
    position_weights_low = Array()
    matrix_norm = Real()  # the largest sum of a row of the matrix from the diagonal on, by sizes
    h = Array("lanes")
    par = Array("parameters", "lanes")
    velocity = Array("rows", "lanes")  # q' = velocity * p

    # --- where the trajectories are ---
    t0 = Array("lanes")
    time_low = Array("lanes")  # what `t0` lacks
    n = Integer()  # steps since `t0`
    state = Array("dim", "lanes")  # q, p or y
    error = Array("dim", "lanes")  # what `state` lacks
    alive = Array("lanes")  # 1: goes on; 0: left, because its equations were not solved
    living = Integer()  # whether any is alive
    iterations = Array("lanes")  # in which the trajectory took part
    rate = Array("lanes")  # binary logarithm of the iteration's contraction, as measured

    # --- a step ---
    values = Array("k", "rows", "lanes")  # of the field, at the stages
    # The values that a step starts from; of adaptive steps the last one's polynomial, by powers of x from -1
    # at its start to 1 at its end.
    ahead = Array("k", "rows", "lanes")
    base = Array("k", "rows", "lanes")  # what a stage has besides the state and the values
    stage = Array("rows", "lanes")
    field_values = Array("rows", "lanes")  # the field there
    factor = Array("rows", "lanes")
    moved = Array("rows", "lanes")  # how much the values of a row have changed
    block_weights = Array("rows", "lanes")  # what that is beside the row's block,
    # and beside its block, small ones raised to a part of the largest
    floored_weights = Array("rows", "lanes")
    size = Array("rows", "lanes")

    # --- adaptive steps ---
    to_legendre = Array()  # values -> Legendre coefficients, (k, k)
    in_powers = Array()  # Legendre polynomials as powers of x, and at the end; see `prepared.in_powers`
    ratio = Array("lanes")  # of the length to that of the step that `values` belong to; 0: none
    begin = Array("lanes")  # where on that step this one begins: at its end, 1, or at its start, 0
    next_state = Array("dim", "lanes")
    next_error = Array("dim", "lanes")
    # what such a step is judged by, as in `Context`, and its end; see `ensemble.control`
    allowed_error = Real()
    allowed_quadrature_error = Real()
    error_power = Real()  # one over the order of the error,
    quadrature_error_power = Real()  # and of the quadrature error
    error_aim = Real()
    quadrature_error_aim = Real()
    error_decay = Real()
    quadrature_error_decay = Real()
    least_slope = Real()
    doubt = Real()
    # Part of a block's size that the error at a jump may be; infinite: it is not looked for
    negligible = Real()
    outermost = Real()  # the first node
    # The field at the end of the previous step; see `Discontinuities.boundary_values`
    ends = Array("rows", "lanes")
    last_coefficients = Array("rows", "lanes")  # its last coefficients there
    next_ends = Array("rows", "lanes")
    next_last_coefficients = Array("rows", "lanes")
    gaps = Array("rows", "lanes")  # between blocks of the field as two steps have it where they meet
    longest = Real()  # no step is longer
    target_iterations = Real()  # iterations to aim at, at most
    worth = Real()  # how much longer steps the errors must allow for the implicit solver (logarithm)
    previous_length = Array("lanes")
    previous_error = Array("lanes")
    previous_quadrature_error = Array("lanes")
    length_limit = Array("lanes")
    stop = Array("lanes")  # time of the next sample
    unwatched = Array("lanes")  # fewer steps than this may follow one another without a look at the lane
    since = Array("lanes")  # steps without one
    ordinary = Array("lanes")  # 1: the last step was one of these

    # --- trajectories, one group after another; see `ensemble.loop` ---
    starts = Array()  # (n, dim)
    all_par = Array()  # (n, parameters)
    all_velocity = Array()  # (n, rows)
    count = Integer()  # samples of a trajectory
    times = Array()
    targets = Array(kind=int)  # steps before each sample,
    parts = Array()  # and the part of a step that is left
    part_indices = Array(kind=int)  # where among all lengths of parts that is; for each length
    part_matrix = Array()  # (k, k): `matrix`,
    part_extrapolation = Array()  # (k, k): `extrapolation`,
    part_norms = Array()  # and `matrix_norm`
    out = Array()  # (n, samples, dim)
    arrived = Array(kind=int)  # (n): LEFT, ARRIVED, ...
    all_iterations = Array(kind=int)  # (n)
    trajectories = Integer()  # n
    at = Integer()  # first trajectory of the group,
    end = Integer()  # and the one after the last to be done
    more = Integer()  # whether others may follow these
    sample = Integer()  # the next one to be made; -1: the group is not loaded

    # --- or one in each lane after another; see `ensemble.own` ---
    contexts = Pointers()  # (lanes): a `Context` for each lane
    start_time = Real()
    first_length = Real()  # of the first step; 0: what the field there suggests
    member = Array("lanes", kind=int)  # which trajectory is on a lane; -1: none
    samples_written = Array("lanes", kind=int)  # its samples
    before = Array("lanes")  # its iterations before the present step
    mark = Array("lanes")  # the time at which it was last seen to get anywhere
    all_steps = Array(kind=int)  # (n)

    # --- events in the steps of these; see `ensemble.watch` ---
    events = Integer()  # how many; 0: nobody looks
    search = Pointer()  # a `Search`, which looks into one lane after another
    partials = Pointers()  # (lanes): a `Context` for partial steps of each lane
    room = Integer()  # for occurrences in its log, of which a step of all lanes may take half
    renews = Integer()  # 1: other parameters change no velocities, and actions may set them in lanes
    function_values = Array("events", "lanes")  # of each lane, one after another: `Search.ends`,
    function_zeros = Array("events", "lanes")  # `Search.touched`,
    function_finite = Array("events", "lanes", kind=int)  # `Search.finite`,
    happened = Array("events", "lanes", kind=int)  # `Search.happened`,
    recent = Array("events", 3, "lanes")  # and `Search.recent`
    # The start of a step of all lanes, where most lanes have taken it when it is looked at.
    start_t0 = Array("lanes")
    start_time_low = Array("lanes")
    start_state = Array("dim", "lanes")
    start_error = Array("dim", "lanes")
    stops = Array()  # (n): when an event has ended a trajectory
