/* Takes readings and signals from standard input in the order they were taken, and writes what the
 * step of an exported header makes of them. The test writes HEADER, STATE, SIGNALS, STEP and SET. */
#include <stdio.h>
#include HEADER

int main(void)
{
    struct { int64_t place; float velocity, temperature, torque, current; int64_t direction; } row;
    STATE state = {0};
    while (fread(&row, sizeof row, 1, stdin) == 1) {
        SIGNALS signals;
        int64_t found;
        SET
        found = STEP(&state, (int32_t)(row.place >> 32), (uint32_t)row.place, &signals);
        fwrite(&found, sizeof found, 1, stdout);
    }
    return 0;
}
