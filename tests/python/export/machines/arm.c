/* Cortex-M under qemu-system-arm: vectors, semihosting, SysTick as a count of instructions. */
#include <stdint.h>

int main(void);
extern uint32_t stack_top;

static void start(void);
__attribute__((section(".vectors"), used)) static const void *const vectors[16] = {
    &stack_top, (const void *)start
};

static void semihost(uint32_t operation, const void *argument)
{
    register uint32_t r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
}

void print_text(const char *text) { semihost(4, text); }

void finish(void)
{
    semihost(0x18, (const void *)0x20026);
    for (;;) {
    }
}

/* SysTick counts down 24 bits. */
uint32_t now(void) { return (0xffffffu - *(volatile uint32_t *)0xe000e018) & 0xffffffu; }

static void start(void)
{
#ifdef __ARM_FP
    *(volatile uint32_t *)0xe000ed88 |= 0xfu << 20; /* let the FPU in */
    __asm__ volatile("dsb\n isb");
#endif
    extern uint32_t data_start, data_end, data_load, bss_start, bss_end;
    uint32_t *to;
    const uint32_t *from = &data_load;
    for (to = &data_start; to < &data_end;) {
        *to++ = *from++;
    }
    for (to = &bss_start; to < &bss_end;) {
        *to++ = 0;
    }
    *(volatile uint32_t *)0xe000e014 = 0xffffff;
    *(volatile uint32_t *)0xe000e018 = 0;
    *(volatile uint32_t *)0xe000e010 = 5;
    main();
    finish();
}

/* What gcc asks of every program, with a library or without. */
void *memcpy(void *to, const void *from, unsigned size)
{
    char *out = to;
    const char *in = from;
    while (size--) {
        *out++ = *in++;
    }
    return to;
}
