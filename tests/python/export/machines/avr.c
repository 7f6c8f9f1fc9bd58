/* ATmega328P under simavr: text by the serial port, Timer 1 as a count of cycles.
 * Its 16 bits go around after 4 ms: an interrupt counts how often. */
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

static volatile uint16_t around;

ISR(TIMER1_OVF_vect) { around++; }

uint32_t now(void)
{
    uint16_t low, high;
    TCCR1B = 1;
    TIMSK1 = 1 << TOIE1;
    sei();
    do { /* again where it went around in between */
        high = around;
        low = TCNT1;
    } while (high != around);
    return (uint32_t)high << 16 | low;
}

void finish(void)
{
    cli();
    sleep_enable();
    for (;;) {
        sleep_cpu(); /* without interrupts: simavr ends */
    }
}
