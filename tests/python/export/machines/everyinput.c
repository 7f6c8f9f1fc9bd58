/* Every reading of 24 bits against Newton's iteration in double: an oracle without the package. */
#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include HEADER

static const double order[4] = {1, 2, 4, 8};
static const double size[4] = {0.012, 0.006, 0.003, 0.0012};
static const double phase[4] = {
    5.057982542713582, 5.076441699143409, 3.237885993554064, 1.7957430321414596
};

int main(void)
{
    const double turn = 2.0 * 3.14159265358979323846;
    double worst = 0.0, sum = 0.0, theta = 0.0;
    uint32_t i;
    for (i = 0; i < (UINT32_C(1) << 24); i++) {
        const double reading = i * (turn / 16777216.0);
        double off;
        int pass, k;
        theta += turn / 16777216.0;
        for (pass = 0; pass < 3; pass++) {
            double value = theta - reading, slope = 1.0;
            for (k = 0; k < 4; k++) {
                const double x = order[k] * theta + phase[k];
                value += size[k] * sin(x);
                slope += size[k] * order[k] * cos(x);
            }
            theta -= value / slope;
        }
        off = CORRECT(i << 8) * (1.0 / 4294967296.0) - theta / turn;
        off = (off - rint(off)) * 1296000.0;
        sum += off * off;
        if (fabs(off) > worst) {
            worst = fabs(off);
        }
    }
    printf("%.9f %.9f\n", worst, sqrt(sum / 16777216.0));
    return 0;
}
