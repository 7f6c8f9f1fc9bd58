#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

void print_text(const char *text) { fputs(text, stdout); }
uint32_t now(void) { return 0; }
void finish(void) { exit(0); }
