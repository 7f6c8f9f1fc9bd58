// Parts of a step at run time (cstep.py), each behind the line with its name. @n@ is the prefix of
// all names, @angle@ and @real@ are the types of `fixed` or of `double` arithmetic.

//@ fixed helpers
static inline float @n@_turns(int64_t angle)
{
    return (float)angle * 2.32830644e-10f;
}

/* Turns as an angle. */
static inline int64_t @n@_angle(float turns)
{
    const float units = turns * 4294967296.0f;
    return (int64_t)(units < 0.0f ? units - 0.5f : units + 0.5f);
}

/* The sine of 2^-32 turns: a polynomial over the quarters beside the zero. */
static inline float @n@_sine(uint32_t phase)
{
    const uint32_t folded = ((phase + UINT32_C(0x40000000)) & UINT32_C(0x80000000))
        ? UINT32_C(0x80000000) - phase : phase;
    const float t = (float)(int32_t)folded * 1.46291808e-9f;
    const float s = t * t;
    return t + t * s * (-0.166666667f + s * (8.33333333e-3f + s * (-1.98412698e-4f
        + s * (2.75573192e-6f + s * -2.50521084e-8f))));
}

//@ fixed decay
/* exp(-way) of a way that is not negative. */
static inline float @n@_decay(float way)
{
    int16_t n;
    float rest, value;
    if (!(way < 80.0f)) {
        return 0.0f;
    }
    n = (int16_t)(way * 1.44269504f + 0.5f);
    rest = ((float)n * 0.693145752f - way) + (float)n * 1.42860677e-6f;
    value = 1.0f + rest * (1.0f + rest * (0.5f + rest * (0.166666667f + rest * (4.16666667e-2f
        + rest * (8.33333333e-3f + rest * (1.38888889e-3f + rest * 1.98412698e-4f))))));
    for (; n >= 16; n = (int16_t)(n - 16)) {
        value *= 1.52587891e-5f;
    }
    return value / (float)(UINT32_C(1) << n);
}

//@ fixed waves
/* Lines C sin(m x + phase): orders, phases and sizes. */
static inline float @n@_waves(int64_t x, const uint32_t *orders, const uint32_t *phases,
    const float *sizes, uint16_t count)
{
    float sum = 0.0f;
    uint16_t i;
    for (i = 0; i < count; i++) {
        sum += TRUEANGLE_F32(sizes + i)
            * @n@_sine((uint32_t)x * TRUEANGLE_U32(orders + i) + TRUEANGLE_U32(phases + i));
    }
    return sum;
}

//@ fixed ratios
/* Lines of orders that are no whole numbers. */
static inline float @n@_ratios(int64_t x, const uint64_t *orders, const uint32_t *phases,
    const float *sizes, uint16_t count)
{
    float sum = 0.0f;
    uint16_t i;
    for (i = 0; i < count; i++) {
        const uint64_t place = (uint64_t)(x >> 32) * orders[2 * i]
            + (uint64_t)(uint32_t)x * orders[2 * i + 1];
        sum += TRUEANGLE_F32(sizes + i)
            * @n@_sine((uint32_t)(place >> 32) + TRUEANGLE_U32(phases + i));
    }
    return sum;
}

//@ double helpers
static inline double @n@_turns(double angle)
{
    return angle;
}

static inline double @n@_angle(double turns)
{
    return turns;
}

/* A place of a shaft that makes so many turns per turn. */
static inline double @n@_place(double x, double cycles)
{
    const double turn = floor(x);
    return turn * (cycles - floor(cycles)) + (x - turn) * cycles;
}

/* The sine of turns. */
static inline double @n@_sine(double phase)
{
    return sin(6.283185307179586 * (phase - floor(phase)));
}

//@ double decay
static inline double @n@_decay(double way)
{
    return exp(-way);
}

//@ double waves
/* Lines C sin(m x + phase): orders, phases and sizes. */
static inline double @n@_waves(double x, const double *orders, const double *phases,
    const double *sizes, uint16_t count)
{
    double sum = 0.0;
    uint16_t i;
    for (i = 0; i < count; i++) {
        sum += sizes[i] * @n@_sine(@n@_place(x, orders[i]) + phases[i]);
    }
    return sum;
}

//@ pattern
static inline int64_t @n@_pattern(int64_t place)
{
    return @n@_correct_unwrapped((int32_t)(place >> 32), (uint32_t)place);
}

//@ bent
/* Wind-up under a load, softer or stiffer beyond a knee. */
static inline @real@ @n@_bent(@real@ m, @real@ linear, @real@ cubic, @real@ beyond, @real@ knee)
{
    const @real@ past = m > knee ? m - knee : m < -knee ? m + knee : 0.0f;
    return linear * m + cubic * m * m * m + beyond * past;
}

//@ size
static inline @real@ @n@_size(@real@ value)
{
    return value < 0.0f ? -value : value;
}

//@ passed
static inline @angle@ @n@_passed(@angle@ x, @angle@ start, @angle@ stop)
{
    return x < start ? start : x > stop ? stop : x;
}

//@ find
/* The angle x with x + pattern + error = goal: secants around the table. */
static inline @angle@ @n@_find(@angle@ goal, const @n@_signals *signals, int8_t direction@along@)
{
    @angle@ before = goal - @zero@;
    @angle@ x = @inverse@(goal - @n@_angle(@n@_error(before, signals, direction@given@)));
    @angle@ off_before = before - x;
    uint8_t i;
    for (i = 0; i < 20; i++) {
        const @angle@ off
            = x - @inverse_near@(goal - @n@_angle(@n@_error(x, signals, direction@given@))@x@);
        const @angle@ moved = x - before;
        @real@ slope;
        if ((@near@) || moved == 0) {
            return x - off;
        }
        slope = (@real@)(off - off_before) / (@real@)moved;
        slope = slope > 0.015625f ? (slope < 2.0f ? slope : 2.0f) : 0.015625f;
        before = x;
        off_before = off;
        x -= (@angle@)((@real@)off / slope);
    }
    return x;
}

//@ find at once
/* The angle x with x + pattern + error = goal: the error is the same at every angle. */
static inline @angle@ @n@_find(@angle@ goal, const @n@_signals *signals, int8_t direction@along@)
{
    return @inverse@(goal - @n@_angle(@n@_error(goal, signals, direction@given@)));
}

//@ good
/* A signal within its limit, or the last one that was. */
static inline float @n@_good(float value, float limit, float last)
{
    return value >= -limit && value <= limit ? value : last;
}

//@ step unwrapped
/* The true angle behind the next reading, with the whole turns of both, in 2^-32 turns. */
static inline int64_t @n@_step_unwrapped(@n@_state *state, int32_t turns, uint32_t raw,
    const @n@_signals *signals)
{
    const int64_t reading = @n@_reading(turns, raw);
    int64_t goal;
    @held@
    goal = @start@ - @n@_angle(@n@_level(signals));
    return @n@_seen(state, reading, goal, signals)@late@;
}

//@ step
/* The true angle behind the next reading. */
static inline uint32_t @n@_step(@n@_state *state, uint32_t raw, const @n@_signals *signals)
{
    return (uint32_t)@n@_step_unwrapped(state, 0, raw, signals);
}

//@ state
/* What later readings need to know of the past: all zero before the first. */
typedef struct {
    @fields@
} @n@_state;

//@ stretch
/* Travel in one direction: where it began, and the springs there. */
typedef struct {
    @angle@ place;
    @real@ wound[@count@];
    int8_t direction, placed;
} @n@_stretch;

//@ signals
/* What is known at a reading. */
typedef struct {
    @fields@
} @n@_signals;

//@ sum
static inline @real@ @function@(@arguments@)
{
    @real@ sum = 0.0f;
    @unused@
    @sums@
    return sum;
}

//@ springs
/* Error of the springs at x on a stretch of travel. */
static inline @real@ @n@_wound(const @n@_stretch *s, @angle@ x)
{
    const @real@ d = (@real@)s->direction;
    const @angle@ gone = s->placed ? (x - s->place) * s->direction : 0;
    const @real@ way = gone > 0 ? @n@_turns(gone) : 0.0f;
    @real@ sum = 0.0f;
    @wound@
    return sum;
}

/* The stretch that begins at the farthest angle. */
static inline @n@_stretch @n@_begun(const @n@_state *state, int8_t direction)
{
    const @n@_stretch *s = &state->stretch;
    const @real@ old = (@real@)s->direction;
    const @angle@ far = state->farthest - s->place;
    const @angle@ gone = s->placed ? far * s->direction : 0;
    const @real@ way = gone > 0 ? @n@_turns(gone) : 0.0f;
    @n@_stretch next;
    next.place = state->farthest;
    next.placed = (int8_t)state->known;
    next.direction = direction;
    @begun@
    return next;
}

//@ advance
/* Moves on to x: coming back without having turned is noise and counts as no way. */
static inline void @n@_advance(@n@_state *state, int8_t direction, @angle@ x)
{
    const @angle@ beyond = (x - state->farthest) * direction;
    const uint8_t fresh = !state->known;
    if (direction != @held@) {
        if (fresh || (direction == -@held@ && beyond < 0)) {
            state->farthest = x;
            state->known = 1;
        }
        @begin@
    }
    if (fresh || beyond > 0) {
        state->farthest = x;
        state->known = 1;
    }
}

//@ seen at once
/* The angle that the encoder saw. */
@seen@
    (void)state;
    (void)reading;
    return @n@_find(goal, signals, 0);
}

//@ seen
static inline @angle@ @n@_seen(@n@_state *state, @angle@ reading, @angle@ goal,
    const @n@_signals *signals)
{

//@ fixed align
    const int64_t away = reading - @zero@ - state->farthest;
    if (state->known && (away > INT64_C(2147483648) || away < -INT64_C(2147483648))) {
        const int64_t turns = (away + INT64_C(2147483648)) & ~INT64_C(4294967295);
        state->farthest += turns;
        @moved@
    }

//@ double align
    const double away = reading - @zero@ - state->farthest;
    if (state->known && fabs(away) > 0.5) {
        const double turns = nearbyint(away);
        state->farthest += turns;
        @moved@
    }

//@ ahead
const @n@_stretch ahead = direction == @held@
    ? state->stretch : @n@_begun(state, direction);

//@ seen by angle
/* The angle that the encoder saw; the joint has moved where it leaves the band of the play. */
@seen@
@align@
    if (!state->known) {
        @first@
        const @angle@ x = @n@_find(goal, signals, 0@given@);
        @n@_advance(state, 0, x);
        return x;
    } else {
        const int8_t first = @held@ < 0 ? -1 : 1;
        uint8_t side;
        for (side = 0; side < 2; side++) {
            const int8_t direction = (int8_t)(side ? -first : first);
            @ahead@
            const @angle@ x = @n@_find(goal, signals, direction@given@);
            if ((x - state->farthest) * direction >= 0) {
                @n@_advance(state, direction, x);
                return x;
            }
        }
    }
    return state->farthest;
}

//@ seen by signal
/* The angle that the encoder saw, travelling as the @way@ says. */
@seen@
@align@
    {
        const int8_t sign = (int8_t)((signals->@way@ > 0) - (signals->@way@ < 0));
        const int8_t direction = sign ? sign : @held@;
        @ahead@
        @angle@ x = @n@_find(goal, signals, direction@given@);
        @behind@
        @n@_advance(state, direction, x);
        return x;
    }
}

//@ behind
if (state->known && !((x - state->farthest) * direction > 0)) {
    /* It did not go on: the springs are what they were or, while turning, go on. */
    x = direction == -state->stretch.direction
        ? @n@_find(goal, signals, direction, &state->stretch, 0.0f)
        : @n@_find(goal, signals, direction, 0,
            @n@_wound(&state->stretch, state->farthest));
}

//@ bump
{
    const @real@ away = @away@;
    sum += @height@ * @n@_decay(@half@ * away * away);
}

//@ fixed turned
(uint32_t)(((uint64_t)(x >> 32) * @turns@
        + (uint64_t)(uint32_t)x * @fraction@) >> 32)

//@ low-pass gain
const @real@ inverse = 1.0f / (1.0f + w * w);
const @real@ real = -w * w * inverse, imaginary = -w * inverse;

//@ damped gain
const @real@ stiff = 1.0f - w * w, loss = @loss@ * w;
const @real@ inverse = 1.0f / (stiff * stiff + loss * loss);
const @real@ real = stiff * inverse - 1.0f, imaginary = -loss * inverse;

//@ filter
{
    uint16_t i;
    for (i = 0; i < @count@; i++) {
        const @real@ w = signals->velocity * @rate@;
        @gain@
        const @kind@ phase = @phase@;
        sum += @size@
            * (real * @n@_sine(phase) + imaginary * @n@_sine(phase + @quarter@));
    }
}
