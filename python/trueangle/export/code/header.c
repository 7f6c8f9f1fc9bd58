// Parts of a header with tables (c.py), each behind the line with its name.

//@ memory
#ifndef TRUEANGLE_TABLE
#if defined(__AVR__)
#include <avr/pgmspace.h>
#define TRUEANGLE_TABLE PROGMEM
#define TRUEANGLE_I16(at) ((int16_t)pgm_read_word(at))
#define TRUEANGLE_I32(at) ((int32_t)pgm_read_dword(at))
#define TRUEANGLE_U32(at) ((uint32_t)pgm_read_dword(at))
#define TRUEANGLE_F32(at) pgm_read_float(at)
#else
#define TRUEANGLE_TABLE
#define TRUEANGLE_I16(at) (*(at))
#define TRUEANGLE_I32(at) (*(at))
#define TRUEANGLE_U32(at) (*(at))
#define TRUEANGLE_F32(at) (*(at))
#endif
#endif

//@ linear q15
static inline int32_t @name@_correction(uint32_t angle)
{
    const int16_t *knot = @name@_knots + (@index@);
    const uint16_t t = (uint16_t)((angle << @bits@) >> 16);
    const int16_t low = @read@(knot);
    const int32_t step = @read@(knot + 1) - low;
    const int32_t base = low * INT32_C(65536) + INT32_C(@half@);
    return (base + step * (int32_t)t) >> @down@;
}

//@ linear q31
static inline int32_t @name@_correction(uint32_t angle)
{
    const int32_t *knot = @name@_knots + (@index@);
    const int32_t t = (int32_t)((angle << @bits@) >> 1);
    const int32_t low = @read@(knot);
    const int64_t step = @read@(knot + 1) - low;
    return low + (int32_t)((step * t + (INT64_C(1) << 30)) >> 31);
}

//@ linear f32
static inline float @name@_radians(uint32_t angle)
{
    const float *knot = @name@_knots + (@index@);
    const float t = (float)((angle << @bits@) >> 8) * 5.9604644775390625e-8f;
    const float low = @read@(knot);
    return low + (@read@(knot + 1) - low) * t;
}

static inline int32_t @name@_correction(uint32_t angle)
{
    return (int32_t)(@name@_radians(angle) * @per_radian@);
}

//@ cubic f32
static inline float @name@_radians(uint32_t angle)
{
    const float *knot = @name@_knots + 2 * (uint32_t)(@index@);
    const float t = (float)((angle << @bits@) >> 8) * 5.9604644775390625e-8f;
    const float low = @read@(knot), rise = @read@(knot + 1);
    const float step = @read@(knot + 2) - low;
    const float third = rise + @read@(knot + 3) - 2.0f * step;
    const float second = step - rise - third;
    return low + t * (rise + t * (second + t * third));
}

static inline int32_t @name@_correction(uint32_t angle)
{
    return (int32_t)(@name@_radians(angle) * @per_radian@);
}

//@ cubic whole
static inline int32_t @name@_scaled(int32_t a, int32_t t)
{
    return (int32_t)(((int64_t)a * t + (INT64_C(1) << 30)) >> 31);
}

static inline int32_t @name@_correction(uint32_t angle)
{
    const @type@ *knot = @name@_knots + 2 * (uint32_t)(@index@);
    const int32_t t = (int32_t)((angle << @bits@) >> 1);
    const int32_t low = @read@(knot)@wide@, rise = @read@(knot + 1)@wide@;
    const int32_t high = @read@(knot + 2)@wide@, end = @read@(knot + 3)@wide@;
    const int32_t step = high - low;
    const int32_t third = rise + end - 2 * step;
    const int32_t second = step - rise - third;
    return low + @name@_scaled(@name@_scaled(@name@_scaled(third, t) + second, t) + rise, t);
}

//@ begin
#ifndef @guard@
#define @guard@

#include <stdint.h>

@memory@

/* Right shifts of negative numbers must keep the sign. */
typedef char @name@_shifts_arithmetically
    [(INT32_C(-1) >> 1) == -1 && (INT64_C(-1) >> 1) == -1 ? 1 : -1];

//@ knots
static const @type@ @name@_knots[@count@] TRUEANGLE_TABLE = {
@rows@
};

/* Subtract this, at an angle of the shaft (@cycles@ cycles per output turn). */
@correction@

//@ correct
/* The true angle behind an indicated one. */
static inline uint32_t @name@_correct(uint32_t indicated)
{
    const uint32_t start = indicated - UINT32_C(@zero@);
    uint32_t corrected = start;
    @steps@
    return corrected;
}

//@ place
/* The angle of a shaft that makes @cycles@ turns per output turn. */
static inline uint32_t @name@_place(int64_t output)
{
    return (uint32_t)(((uint64_t)(output >> 32) * UINT64_C(@turns@)
        + (uint64_t)(uint32_t)output * UINT64_C(@fraction@)) >> 32);
}

//@ correct unwrapped
/* A reading with its whole turns, which end at 2^29 either way: no difference overflows. */
static inline int64_t @name@_reading(int32_t turns, uint32_t angle)
{
    const int32_t most = INT32_C(536870912);
    const int32_t held = turns > most ? most : turns < -most ? -most : turns;
    return held * INT64_C(4294967296) + angle;
}

/* The same with the whole turns of the output, before and after; 2^-32 turns. */
static inline int64_t @name@_correct_unwrapped(int32_t turns, uint32_t angle)
{
    const int64_t start = @name@_reading(turns, angle) - @zero@;
    int64_t corrected = start;
    @steps@
    return corrected;
}

//@ self test
/* 0 where this program computes what was proven: run it once on the device. */
static inline int @name@_self_test(void)
{
    static const struct { int32_t turns; uint32_t angle, corrected; } tests[8] = {
@tests@
    };
    int i;
    for (i = 0; i < 8; i++) {
        const uint32_t off = @result@ - tests[i].corrected;
        if (off + UINT32_C(@close@) > UINT32_C(@twice@)) {
            return i + 1;
        }
    }
    return 0;
}

//@ decode
/* The angle of two channels in 2^-32 turns; 0 where both are at their middle or not finite. Compile
   with -ffp-contract=off for the last bit. */
static inline uint32_t @decode@(double sine, double cosine)
{
    static const double c[11] = {
        1.0, -0.3333333333332844, 0.1999999999885511,
        -0.14285714180976467, 0.11111106180455946, -0.09090773074808414,
        0.07689953496306857, -0.06640233930429408, 0.056883492268090106,
        -0.04348052215716463, 0.021135373157693246
    };
    const double pi = 3.141592653589793;
    const double x = (cosine - (@offset_cosine@)) * @per_cosine@;
    const double y = (sine - (@offset_sine@)) * @per_sine@ - x * (@slope@);
    const double along = x < 0.0 ? -x : x, across = y < 0.0 ? -y : y;
    const int steep = across > along;
    const double most = steep ? across : along, least = steep ? along : across;
    /* Above the tangent of an eighth of a turn's half the argument is turned by pi / 4. */
    const int turned = least > 0.41421356237309515 * most;
    const double t = turned ? (least - most) / (least + most) : least / most;
    const double w = t * t, w2 = w * w, w4 = w2 * w2;
    const double low = (c[0] + c[1] * w) + (c[2] + c[3] * w) * w2;
    const double middle = (c[4] + c[5] * w) + (c[6] + c[7] * w) * w2;
    const double high = (c[8] + c[9] * w) + c[10] * w2;
    const double octant = (low + (middle + high * w4) * w4) * t + (turned ? 0.25 * pi : 0.0);
    const double quadrant = steep ? 0.5 * pi - octant : octant;
    const double half = x < 0.0 ? pi - quadrant : quadrant;
    const double angle = (y < 0.0 ? -half : half) * (@factor@);
    if (!(angle > -4294967296.0 && angle < 4294967296.0)) {
        return 0;
    }
    return (uint32_t)(int64_t)(angle + (angle < 0.0 ? -0.5 : 0.5));
}

//@ tracks
/* The angle of two tracks in 2^-32 turns over a whole turn: the second one chooses the period of the
   first. */
static inline uint32_t @decode@(double sine, double cosine, double sine2, double cosine2)
{
    const int64_t fine = (int32_t)@one@(sine, cosine);
    const int64_t coarse = (int32_t)@two@(sine2, cosine2);
    const uint64_t steps = (uint64_t)((coarse - fine) * INT64_C(@product@) + INT64_C(@lift@));
    const uint64_t period = (steps >> 32) % @first@u * @inverse@u % @first@u;
    return (uint32_t)fine + (uint32_t)(((period << 32) + @half@u) / @first@u);
}
