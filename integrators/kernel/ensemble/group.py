"""The memory of a group of trajectories, one in each lane, by name.

A row holds one number of every trajectory, side by side. Arrays of rows are declared with the
number of rows first; `lanes` is the length of a row.
"""

from integrators.kernel.native.memory import Array, Integer, Memory, Pointer, Pointers, Real, Table

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
    nodes = Table()
    nodes_low = Table()
    weights = Table()
    weights_low = Table()
    position_weights = Table()
    position_weights_low = Table()
    matrix_norm = Real()  # the largest sum of a row of the matrix from the diagonal on, by sizes
    h = Table("lanes")
    par = Table("parameters", "lanes")
    velocity = Table("rows", "lanes")  # q' = velocity * p

    # --- where the trajectories are ---
    t0 = Table("lanes")
    time_low = Table("lanes")  # what `t0` lacks
    n = Integer()  # steps since `t0`, or of adaptive ones since the group was last looked after
    state = Table("dim", "lanes")  # q, p or y
    error = Table("dim", "lanes")  # what `state` lacks
    alive = Table("lanes")  # 1: goes on; 0: left, because its equations were not solved
    living = Integer()  # whether any is alive
    iterations = Table("lanes")  # in which the trajectory took part
    rate = Table("lanes")  # binary logarithm of the iteration's contraction, as measured

    # --- a step ---
    values = Table("k", "rows", "lanes")  # of the field, at the stages
    # The values that a step starts from; of adaptive steps the last one's polynomial, by powers of x from -1
    # at its start to 1 at its end.
    ahead = Table("k", "rows", "lanes")
    base = Table("k", "rows", "lanes")  # what a stage has besides the state and the values
    stage = Table("rows", "lanes")
    field_values = Table("rows", "lanes")  # the field there
    factor = Table("rows", "lanes")
    moved = Table("rows", "lanes")  # how much the values of a row have changed
    block_weights = Table("rows", "lanes")  # what that is beside the row's block,
    # and beside its block, small ones raised to a part of the largest
    floored_weights = Table("rows", "lanes")
    size = Table("rows", "lanes")

    # --- adaptive steps ---
    to_legendre = Table()  # values -> Legendre coefficients, (k, k)
    in_powers = Table()  # Legendre polynomials as powers of x, and at the end; see `prepared.in_powers`
    ratio = Table("lanes")  # of the length to that of the step that `values` belong to; 0: none
    begin = Table("lanes")  # where on that step this one begins: at its end, 1, or at its start, 0
    next_state = Table("dim", "lanes")
    next_error = Table("dim", "lanes")
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
    ends = Table("rows", "lanes")
    last_coefficients = Table("rows", "lanes")  # its last coefficients there
    next_ends = Table("rows", "lanes")
    next_last_coefficients = Table("rows", "lanes")
    gaps = Table("rows", "lanes")  # between blocks of the field as two steps have it where they meet
    longest = Real()  # no step is longer
    target_iterations = Real()  # iterations to aim at, at most
    worth = Real()  # how much longer steps the errors must allow for the implicit solver (logarithm)
    previous_length = Table("lanes")
    previous_error = Table("lanes")
    previous_quadrature_error = Table("lanes")
    length_limit = Table("lanes")
    stop = Table("lanes")  # time of the next sample
    unwatched = Table("lanes")  # fewer steps than this may follow one another without a look at the lane
    since = Table("lanes")  # steps without one
    ordinary = Table("lanes")  # 1: the last step was one of these

    # --- trajectories, one group after another; see `ensemble.loop` ---
    starts = Table()  # (n, dim)
    all_par = Table()  # (n, parameters)
    all_velocity = Table()  # (n, rows)
    count = Integer()  # samples of a trajectory
    times = Table()
    targets = Table(kind=int)  # steps before each sample,
    parts = Table()  # and the part of a step that is left
    part_indices = Table(kind=int)  # where among all lengths of parts that is; for each length
    part_matrix = Table()  # (k, k): `matrix`,
    part_extrapolation = Table()  # (k, k): `extrapolation`,
    part_norms = Table()  # and `matrix_norm`
    out = Table()  # (n, samples, dim)
    arrived = Table(kind=int)  # (n): LEFT, ARRIVED, ...
    all_iterations = Table(kind=int)  # (n)
    trajectories = Integer()  # n
    at = Integer()  # first trajectory of the group,
    end = Integer()  # and the one after the last to be done
    more = Integer()  # whether others may follow these
    sample = Integer()  # the next one to be made; -1: the group is not loaded

    # --- or one in each lane after another; see `ensemble.own` ---
    contexts = Pointers()  # (lanes): a `Context` for each lane
    start_time = Real()
    first_length = Real()  # of the first step; 0: what the field there suggests
    member = Table("lanes", kind=int)  # which trajectory is on a lane; -1: none
    samples_written = Table("lanes", kind=int)  # its samples
    before = Table("lanes")  # its iterations before the present step
    mark = Table("lanes")  # the time at which it was last seen to get anywhere
    all_steps = Table(kind=int)  # (n)

    # --- events in the steps of these; see `ensemble.watch` ---
    events = Integer()  # how many; 0: nobody looks
    search = Pointer()  # a `Search`, which looks into one lane after another
    partials = Pointers()  # (lanes): a `Context` for partial steps of each lane
    room = Integer()  # for occurrences in its log, of which a step of all lanes may take half
    renews = Integer()  # 1: other parameters change no velocities, and actions may set them in lanes
    function_values = Table("events", "lanes")  # of each lane, one after another: `Search.ends`,
    function_zeros = Table("events", "lanes")  # `Search.touched`,
    function_finite = Table("events", "lanes", kind=int)  # `Search.finite`,
    happened = Table("events", "lanes", kind=int)  # `Search.happened`,
    recent = Table("events", 3, "lanes")  # and `Search.recent`
    # The start of a step of all lanes, where most lanes have taken it when it is looked at.
    start_t0 = Table("lanes")
    start_time_low = Table("lanes")
    start_state = Table("dim", "lanes")
    start_error = Table("dim", "lanes")
    stops = Table()  # (n): when an event has ended a trajectory
