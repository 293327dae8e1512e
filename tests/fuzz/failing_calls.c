/* Preloaded into a process: the n-th call that changes a file below a folder fails as on a full disk, once.

   fail_at(n, folder) arms it; FAIL_AT and FAIL_BELOW in the environment arm it from the start, as in child processes. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

static long wanted = 0, made = 0;
static char folder[4096];

void fail_at(long n, const char *below) {
    snprintf(folder, sizeof folder, "%s", below);
    made = 0;
    wanted = n;
}

long calls_made(void) { return made; }

__attribute__((constructor)) static void arm(void) {
    const char *n = getenv("FAIL_AT"), *below = getenv("FAIL_BELOW");
    if (n && below) fail_at(atol(n), below);
}

static int fails(const char *path) {
    if (!wanted || !path || strncmp(path, folder, strlen(folder)) != 0) return 0;
    if (__atomic_add_fetch(&made, 1, __ATOMIC_SEQ_CST) != wanted) return 0;
    errno = ENOSPC;
    return 1;
}

static int fails_on(int file) {
    char name[64], path[4096];
    if (!wanted) return 0;
    snprintf(name, sizeof name, "/proc/self/fd/%d", file);
    ssize_t length = readlink(name, path, sizeof path - 1);
    if (length < 0) return 0;
    path[length] = 0;
    return fails(path);
}

#define NEXT(result, name, ...) static result (*next)(__VA_ARGS__); if (!next) next = dlsym(RTLD_NEXT, name)

ssize_t write(int f, const void *b, size_t n) { NEXT(ssize_t, "write", int, const void *, size_t); return fails_on(f) ? -1 : next(f, b, n); }
ssize_t pwrite(int f, const void *b, size_t n, off_t o) { NEXT(ssize_t, "pwrite", int, const void *, size_t, off_t); return fails_on(f) ? -1 : next(f, b, n, o); }
ssize_t pwrite64(int f, const void *b, size_t n, off64_t o) { NEXT(ssize_t, "pwrite64", int, const void *, size_t, off64_t); return fails_on(f) ? -1 : next(f, b, n, o); }
ssize_t writev(int f, const struct iovec *b, int n) { NEXT(ssize_t, "writev", int, const struct iovec *, int); return fails_on(f) ? -1 : next(f, b, n); }
int fsync(int f) { NEXT(int, "fsync", int); return fails_on(f) ? -1 : next(f); }
int fdatasync(int f) { NEXT(int, "fdatasync", int); return fails_on(f) ? -1 : next(f); }
int ftruncate(int f, off_t n) { NEXT(int, "ftruncate", int, off_t); return fails_on(f) ? -1 : next(f, n); }
int ftruncate64(int f, off64_t n) { NEXT(int, "ftruncate64", int, off64_t); return fails_on(f) ? -1 : next(f, n); }
int rename(const char *a, const char *b) { NEXT(int, "rename", const char *, const char *); return fails(b) ? -1 : next(a, b); }
int mkdir(const char *p, mode_t m) { NEXT(int, "mkdir", const char *, mode_t); return fails(p) ? -1 : next(p, m); }

static mode_t mode_of(int flags, va_list list) { return flags & (O_CREAT | O_TMPFILE) ? (mode_t)va_arg(list, int) : 0; }

#define OPEN(name) \
    int name(const char *p, int flags, ...) { \
        NEXT(int, #name, const char *, int, ...); \
        va_list list; va_start(list, flags); mode_t mode = mode_of(flags, list); va_end(list); \
        return flags & (O_CREAT | O_WRONLY | O_RDWR) && fails(p) ? -1 : next(p, flags, mode); \
    }
OPEN(open)
OPEN(open64)
