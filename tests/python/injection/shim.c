/* Calls of the system that fail when told to: loaded before libc (LD_PRELOAD) by the tests.
 *
 * `shim_arm(kind, n, action, error)` lets the n-th call of a kind (from 0) fail with `error`,
 * end the process as if by kill -9, come with Ctrl-C, SIGTERM or SIGHUP, or (writes) take only
 * half. Calls on files below the root count; of allocations those of at least so many bytes
 * that the core itself makes. CHANGE counts all that change what is on the disk; with PAUSE the
 * process stops before each of them until it is told to go on.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <pthread.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

enum { OPEN, READ, WRITE, SYNC, RENAME, ALLOCATE, THREAD, FOLDER, REMOVE, CHANGE, KINDS };
enum { FAIL, KILL, HALF, INTERRUPT, TERMINATE, HANG_UP, PAUSE };

static char root[PATH_MAX];
static long counts[KINDS];
static int armed_kind = -1, armed_action, armed_error, counting;
static long armed_n;
static size_t least;
static char *core_begin, *core_end;

void shim_root(const char *path) { strncpy(root, path, sizeof root - 1); }

void shim_core(char *begin, char *end, size_t bytes) {
    core_begin = begin;
    core_end = end;
    least = bytes;
}

void shim_arm(int kind, long n, int action, int error) {
    memset(counts, 0, sizeof counts);
    armed_kind = kind, armed_n = n, armed_action = action, armed_error = error;
    counting = 1;
}

long shim_count(int kind) { return counts[kind]; }

void shim_stop(void) { counting = 0; }

/* Whether this call is to fail; a kill does not come back, other signals let it be done. */
static int strikes(int kind) {
    static const int signals[] = {[INTERRUPT] = SIGINT, [TERMINATE] = SIGTERM, [HANG_UP] = SIGHUP};
    int changes = kind != READ && kind != ALLOCATE && kind != THREAD && kind != CHANGE;
    if (changes && armed_kind == CHANGE) {
        if (armed_action == PAUSE) kill(getpid(), SIGSTOP);
        if (strikes(CHANGE)) return 1;
    }
    if (__sync_fetch_and_add(&counts[kind], 1) != armed_n || kind != armed_kind) return 0;
    if (armed_action == KILL) kill(getpid(), SIGKILL), pause();
    if (armed_action >= INTERRUPT) return kill(getpid(), signals[armed_action]), 0;
    errno = armed_error;
    return 1;
}

static int below(const char *path) {
    return counting && root[0] && path && strncmp(path, root, strlen(root)) == 0;
}

static int of_root(int fd) {
    if (!counting) return 0;
    char link[64], path[PATH_MAX];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t size = readlink(link, path, sizeof path - 1);
    if (size < 0) return 0;
    path[size] = 0;
    return below(path);
}

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

#define OPENING(name)                                                  \
    int name(const char *path, int flags, ...) {                       \
        mode_t mode = 0;                                               \
        if (flags & (O_CREAT | __O_TMPFILE)) {                         \
            va_list more;                                              \
            va_start(more, flags);                                     \
            mode = va_arg(more, mode_t);                               \
            va_end(more);                                              \
        }                                                              \
        if (below(path) && strikes(OPEN)) return -1;                   \
        return REAL(name)(path, flags, mode);                          \
    }
OPENING(open)
OPENING(open64)

FILE *fopen(const char *path, const char *mode) {
    if (below(path) && strikes(OPEN)) return NULL;
    return REAL(fopen)(path, mode);
}

FILE *fopen64(const char *path, const char *mode) {
    if (below(path) && strikes(OPEN)) return NULL;
    return REAL(fopen64)(path, mode);
}

ssize_t read(int fd, void *buffer, size_t size) {
    if (of_root(fd) && strikes(READ)) return -1;
    return REAL(read)(fd, buffer, size);
}

ssize_t pread(int fd, void *buffer, size_t size, off_t offset) {
    if (of_root(fd) && strikes(READ)) return -1;
    return REAL(pread)(fd, buffer, size, offset);
}

ssize_t pread64(int fd, void *buffer, size_t size, off64_t offset) {
    if (of_root(fd) && strikes(READ)) return -1;
    return REAL(pread64)(fd, buffer, size, offset);
}

ssize_t write(int fd, const void *buffer, size_t size) {
    if (of_root(fd) && strikes(WRITE)) {
        if (armed_action != HALF || size < 2) return -1;
        return REAL(write)(fd, buffer, size / 2);
    }
    return REAL(write)(fd, buffer, size);
}

ssize_t pwrite(int fd, const void *buffer, size_t size, off_t offset) {
    if (of_root(fd) && strikes(WRITE)) return -1;
    return REAL(pwrite)(fd, buffer, size, offset);
}

ssize_t pwrite64(int fd, const void *buffer, size_t size, off64_t offset) {
    if (of_root(fd) && strikes(WRITE)) return -1;
    return REAL(pwrite64)(fd, buffer, size, offset);
}

ssize_t writev(int fd, const struct iovec *parts, int count) {
    if (of_root(fd) && strikes(WRITE)) return -1;
    return REAL(writev)(fd, parts, count);
}

/* No test here lets the power fail: what the disk would wait for is not waited for. */
int fsync(int fd) {
    if (!of_root(fd)) return REAL(fsync)(fd);
    return strikes(SYNC) ? -1 : 0;
}

int rename(const char *old, const char *fresh) {
    if (below(fresh) && strikes(RENAME)) return -1;
    return REAL(rename)(old, fresh);
}

static int cannot_exchange;

/* Whether names can be exchanged in one step: not on every system. */
void shim_exchange(int possible) { cannot_exchange = !possible; }

int renameat2(int old_fd, const char *old, int fresh_fd, const char *fresh, unsigned flags) {
    if (counting && cannot_exchange) return errno = ENOSYS, -1;
    if (below(fresh) && strikes(RENAME)) return -1;
    return REAL(renameat2)(old_fd, old, fresh_fd, fresh, flags);
}

int mkdir(const char *path, mode_t mode) {
    if (below(path) && strikes(FOLDER)) return -1;
    return REAL(mkdir)(path, mode);
}

int unlink(const char *path) {
    if (below(path) && strikes(REMOVE)) return -1;
    return REAL(unlink)(path);
}

int unlinkat(int fd, const char *path, int flags) {
    if ((below(path) || of_root(fd)) && strikes(REMOVE)) return -1;
    return REAL(unlinkat)(fd, path, flags);
}

int rmdir(const char *path) {
    if (below(path) && strikes(REMOVE)) return -1;
    return REAL(rmdir)(path);
}

int pthread_create(pthread_t *thread, const pthread_attr_t *attributes, void *(*start)(void *),
                   void *argument) {
    char *caller = __builtin_return_address(0);
    if (counting && caller >= core_begin && caller < core_end && strikes(THREAD))
        return armed_error;
    return REAL(pthread_create)(thread, attributes, start, argument);
}

/* dlsym itself allocates: the real functions are asked for by their other names. */
extern void *__libc_malloc(size_t), *__libc_calloc(size_t, size_t), *__libc_realloc(void *, size_t);
extern void *__libc_memalign(size_t, size_t);

#define OF_CORE(size)                                                                 \
    (counting && (size) >= least && (char *)__builtin_return_address(0) >= core_begin && \
     (char *)__builtin_return_address(0) < core_end)

void *malloc(size_t size) {
    if (OF_CORE(size) && strikes(ALLOCATE)) return NULL;
    return __libc_malloc(size);
}

void *calloc(size_t count, size_t size) {
    if (OF_CORE(count * size) && strikes(ALLOCATE)) return NULL;
    return __libc_calloc(count, size);
}

void *realloc(void *old, size_t size) {
    if (OF_CORE(size) && strikes(ALLOCATE)) return NULL;
    return __libc_realloc(old, size);
}

int posix_memalign(void **place, size_t alignment, size_t size) {
    if (OF_CORE(size) && strikes(ALLOCATE)) return ENOMEM;
    *place = __libc_memalign(alignment, size);
    return *place ? 0 : ENOMEM;
}
