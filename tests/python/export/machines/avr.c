/* ATmega328P under simavr: text by the serial port, Timer 1 as a count of cycles. */
#include <stdint.h>
#include <avr/io.h>
#include <avr/interrupt.h>
#include <avr/sleep.h>

void print_text(const char *text)
{
    UCSR0B = 1 << TXEN0;
    for (; *text; text++) {
        while (!(UCSR0A & (1 << UDRE0))) {
        }
        UDR0 = (uint8_t)*text;
    }
}

uint32_t now(void)
{
    TCCR1B = 1;
    return TCNT1;
}

void finish(void)
{
    cli();
    sleep_enable();
    for (;;) {
        sleep_cpu(); /* without interrupts: simavr ends */
    }
}
