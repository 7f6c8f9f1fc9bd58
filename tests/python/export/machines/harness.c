/* Runs an exported table over many angles, prints a hash of what it makes and what a look-up costs.
 * The test writes the names: FUNCTION, HEADER, COUNT, and PLACE of the machine (arm, avr, host). */
#include <stdint.h>
#include HEADER

void print_text(const char *text);
uint32_t now(void);
void finish(void);

static void print_number(const char *name, uint32_t value)
{
    char digits[9];
    int8_t i;
    for (i = 0; i < 8; i++) {
        const uint8_t nibble = (uint8_t)((value >> (28 - 4 * i)) & 15u);
        digits[i] = (char)(nibble < 10 ? '0' + nibble : 'a' + nibble - 10);
    }
    digits[8] = 0;
    print_text(name);
    print_text("=");
    print_text(digits);
    print_text("\n");
}

static volatile int32_t sink;
static volatile uint32_t source = 0x12345678u;

__attribute__((noinline)) static uint32_t timed(uint16_t times)
{
    uint16_t i;
    const uint32_t begin = now();
    for (i = 0; i < times; i++) {
        sink = FUNCTION(source);
    }
    return now() - begin;
}

__attribute__((noinline)) static uint32_t empty(uint16_t times)
{
    uint16_t i;
    const uint32_t begin = now();
    for (i = 0; i < times; i++) {
        sink = (int32_t)source;
    }
    return now() - begin;
}

int main(void)
{
    uint32_t hash = UINT32_C(2166136261), i;
    print_number("self", (uint32_t)TEST());
    for (i = 0; i < COUNT; i++) {
        const uint32_t out = CORRECT(i * UINT32_C(2654435761));
        uint8_t k;
        for (k = 0; k < 32; k = (uint8_t)(k + 8)) {
            hash = (hash ^ ((out >> k) & 255u)) * UINT32_C(16777619);
        }
    }
    print_number("hash", hash);
    print_number("none", empty(1));
    print_number("once", timed(1));
    print_number("loop", empty(TIMES));
    print_number("call", timed(TIMES));
    finish();
    return 0;
}
