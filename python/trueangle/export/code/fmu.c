// Parts of the source of a functional mock-up unit (fmufiles.py), each behind the line with its name.

//@ includes
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-function"
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
#if defined(_WIN32)
#define PUBLIC __declspec(dllexport)
#else
#define PUBLIC __attribute__((visibility("default")))
#endif

//@ series
/* The series, its slope where asked for, and the x with x + sign (zero + series(x)) = y. */
static double m_series(double x, double *slope)
{
    double sum = 0.0, rise = 0.0;
    int i;
    @sum@
    if (slope) {
        *slope = rise;
    }
    return sum;
}

static double m_solved(double y, double sign, double x)
{
    double low = y - sign * @zero@ - @size@, high = y - sign * @zero@ + @size@;
    int i;
    for (i = 0; i < 200; i++) {
        double slope, next;
        const double off = x + sign * (@zero@ + m_series(x, &slope)) - y;
        if (off > 0.0) {
            high = x;
        } else {
            low = x;
        }
        next = x - off / (1.0 + sign * slope);
        if (!(next >= low && next <= high)) {
            next = 0.5 * (low + high);
        }
        /* A step of Newton's leaves half the curvature times its square. */
        if (fabs(next - x) <= @near@ + 2e-16 * (1.0 + fabs(x))) {
            return next;
        }
        x = next;
    }
    return x;
}

static inline double m_pattern(double place)
{
    return m_solved(place, 1.0, place - @zero@);
}

static inline double m_pattern_from(double place, double near)
{
    return m_solved(place, 1.0, near);
}

//@ sum
for (i = 0; i < @count@; i++) {
    const double phase = m_place(x, m_series0_orders[i]) + m_series0_phases[i];
    const double turned = 6.283185307179586 * (phase - floor(phase));
    sum += m_series0_sizes[i] * sin(turned);
    if (slope) {
        rise += 6.283185307179586 * m_series0_orders[i] * m_series0_sizes[i] * cos(turned);
    }
}

//@ correct
/* The true angle behind the next reading, in turns. */
static double m_output(m_state *state, double reading, const m_signals *signals)
{
    const double start = @start@;
    return m_seen(state, reading, start - m_level(signals), signals)@late@;
}

//@ decode
/* The angle of two channels, in turns. */
static double @decode@(double sine, double cosine)
{
    const double x = (cosine - (@offset_cosine@)) * @per_cosine@;
    const double y = (sine - (@offset_sine@)) * @per_sine@ - x * (@slope@);
    return x == 0.0 && y == 0.0 ? NAN : atan2(y, x) * (@factor@);
}

//@ tracks
/* The angle of two tracks, in turns within half of one: the second chooses the period of the first. */
static double @decode@(double sine, double cosine, double sine2, double cosine2)
{
    const double fine = @one@(sine, cosine), coarse = @two@(sine2, cosine2);
    const double steps = floor((coarse - fine) * @product@.0 + @lift@.0 / 4294967296.0);
    const double turn = fine + fmod(fmod(steps, @first@.0) * @inverse@.0, @first@.0) / @first@.0;
    return turn - ceil(turn - 0.5);
}

//@ sense
/* What the encoder says at the next true angle, in turns. */
static double m_output(m_state *state, double theta, const m_signals *signals)
{
    const double seen = theta@early@;
    double y;
    @travel@
    y = seen + m_level(signals) + m_error(seen, signals, @direction@);
    return @reading@;
}

//@ sensed travel
const double away = seen - state->farthest;
if (state->known && fabs(away) > 0.5) {
    const double turns = nearbyint(away);
    state->farthest += turns;
    @moved@
}
{
    const double way = @way@;
    const int8_t sign = (int8_t)((way > 0.0) - (way < 0.0));
    m_advance(state, sign ? sign : @held@, seen);
}

//@ instance
/* -- the instance ----------------------------------------------------------------------- */

enum { VARIABLES = @count@, OUTPUT = @output@, NOISE = @noise@, SEED = @seed@ };

typedef struct {
    m_state state;
    uint64_t random;
    double value[VARIABLES]; /* by value reference; 0 is the time */
    double spare;            /* the second of a pair of normal numbers */
    int has_spare, stale, begun;
} Instance;

static void reset(Instance *me)
{
    static const double start[VARIABLES] = {@start@};
    memset(me, 0, sizeof *me);
    memcpy(me->value, start, sizeof start);
    me->stale = 1;
}

/* A normal number: xorshift64*, and Box and Muller's pair. */
static double normal(Instance *me)
{
    double u[2], size;
    int i;
    if (me->has_spare) {
        me->has_spare = 0;
        return me->spare;
    }
    if (!me->random) {
        me->random = UINT64_C(0x9E3779B97F4A7C15) * (1u + (uint64_t)fabs(me->value[SEED]));
    }
    for (i = 0; i < 2; i++) {
        me->random ^= me->random >> 12;
        me->random ^= me->random << 25;
        me->random ^= me->random >> 27;
        u[i] = (double)((me->random * UINT64_C(0x2545F4914F6CDD1D)) >> 11) * 0x1p-53;
    }
    size = sqrt(-2.0 * log(1.0 - u[0]));
    me->spare = size * sin(6.283185307179586 * u[1]);
    me->has_spare = 1;
    return size * cos(6.283185307179586 * u[1]);
}

/* One reading: the state moves on and the output is of the inputs as they are. */
static void step(Instance *me)
{
    const double turn = 6.283185307179586;
    const m_state before = me->state;
    double known = 0.0;
    m_signals signals;
    memset(&signals, 0, sizeof signals);
    @signals@
    me->value[OUTPUT] = turn * m_output(&me->state, @reading@, &signals);
    if (!isfinite(known + me->value[OUTPUT])) {
        /* As the corrector does: no number, and the next reading follows the last good one. */
        me->state = before;
        me->value[OUTPUT] = NAN;
    }
    if (NOISE && me->value[NOISE] > 0.0) {
        me->value[OUTPUT] += me->value[NOISE] * normal(me);
    }
    me->stale = 0;
    me->begun = 1;
}

/* The output of inputs that are not a reading yet: the state stays. */
static void look(Instance *me)
{
    if (me->stale) {
        Instance copy = *me;
        step(&copy);
        me->value[OUTPUT] = copy.value[OUTPUT];
        me->stale = 0;
    }
}

static int get(Instance *me, const unsigned *references, size_t count, double *values)
{
    size_t i;
    for (i = 0; i < count; i++) {
        if (references[i] >= VARIABLES) {
            return 3;
        }
        if (references[i] == OUTPUT) {
            look(me);
        }
        values[i] = me->value[references[i]];
    }
    return 0;
}

static int set(Instance *me, const unsigned *references, size_t count, const double *values)
{
    size_t i;
    for (i = 0; i < count; i++) {
        if (references[i] >= VARIABLES || references[i] == OUTPUT) {
            return 3;
        }
        me->value[references[i]] = values[i];
        me->stale = 1;
    }
    return 0;
}

//@ created
static void *created(void)
{
    Instance *me = malloc(sizeof *me);
    if (me) {
        reset(me);
    }
    return me;
}

/* In model exchange the first reading is that at the start. */
static int continuous(Instance *me)
{
    if (!me->begun) {
        step(me);
    }
    return 0;
}

static int kept(Instance *me, void **state)
{
    if (!*state) {
        *state = malloc(sizeof *me);
    }
    if (!*state) {
        return 3;
    }
    memcpy(*state, me, sizeof *me);
    return 0;
}
