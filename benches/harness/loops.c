#include <math.h>
#include <stddef.h>

/* Every order its own cosine and sine; the loop over readings is the inner one. */
void per_order(const double *restrict x, double *restrict y, size_t n, double constant,
               const double *restrict k, const double *restrict a,
               const double *restrict b, size_t orders) {
    const size_t block = 512;
    #pragma omp parallel for
    for (size_t start = 0; start < n; start += block) {
        const size_t stop = start + block < n ? start + block : n;
        for (size_t i = start; i < stop; i++) y[i] = constant;
        for (size_t j = 0; j < orders; j++) {
            /* Apart: both of one angle in one loop GCC takes for a call that is no vector's. */
            for (size_t i = start; i < stop; i++) y[i] += a[j] * cos(k[j] * x[i]);
            for (size_t i = start; i < stop; i++) y[i] += b[j] * sin(k[j] * x[i]);
        }
    }
}

/* One cosine and sine, then Horner's rule of e^{ix} over dense orders from `orders` down. */
void horner(const double *restrict x, double *restrict y, size_t n, double constant,
            const double *restrict k, const double *restrict a,
               const double *restrict b, size_t orders) {
    const size_t block = 512;
    #pragma omp parallel for
    for (size_t start = 0; start < n; start += block) {
        const size_t size = start + block < n ? block : n - start;
        double c[512], s[512], re[512], im[512];
        for (size_t i = 0; i < size; i++) c[i] = cos(x[start + i]);
        for (size_t i = 0; i < size; i++) s[i] = sin(x[start + i]);
        for (size_t i = 0; i < size; i++) re[i] = im[i] = 0.0;
        for (size_t j = orders; j-- > 0;)
            for (size_t i = 0; i < size; i++) {
                const double p = re[i] + a[j], q = im[i] - b[j];
                re[i] = p * c[i] - q * s[i];
                im[i] = p * s[i] + q * c[i];
            }
        for (size_t i = 0; i < size; i++) y[start + i] = constant + re[i];
    }
}
