/* A library for LD_PRELOAD that lets one operation on files beneath a folder fail, as a full or broken disk does.

   PLUG_FOLDER   absolute path of the folder
   PLUG_NUMBER   which operation fails: 1 is the first write, opening for writing, truncation, synchronisation or renaming
   PLUG_ERROR    number of the error, such as 28 for ENOSPC
   PLUG_REPORT   file that is made when it has failed

   All operations after it fail as well if the error is ENOSPC: a full disk stays full. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

static atomic_long count;

static int beneath(const char *path) {
    const char *folder = getenv("PLUG_FOLDER");
    char full[2 * PATH_MAX];
    if (!folder || !path) return 0;
    if (path[0] != '/') {
        char here[PATH_MAX];
        if (!getcwd(here, sizeof here)) return 0;
        snprintf(full, sizeof full, "%s/%s", here, path);
        path = full;
    }
    return !strncmp(path, folder, strlen(folder));
}

static int fails(void) {
    long which = atol(getenv("PLUG_NUMBER")), now = atomic_fetch_add(&count, 1) + 1;
    int error = atoi(getenv("PLUG_ERROR"));
    if (now < which || (now > which && error != ENOSPC)) return 0;
    const char *report = getenv("PLUG_REPORT");
    int (*real_open)(const char *, int, ...) = dlsym(RTLD_NEXT, "open");
    int handle = report ? real_open(report, O_CREAT | O_WRONLY, 0644) : -1;
    if (handle >= 0) close(handle);
    errno = error;
    return 1;
}

static int fails_on(int handle) {
    char link[64], path[PATH_MAX];
    snprintf(link, sizeof link, "/proc/self/fd/%d", handle);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (length < 0) return 0;
    path[length] = 0;
    return beneath(path) && fails();
}

#define REAL(type, name, ...) type (*real)(__VA_ARGS__) = dlsym(RTLD_NEXT, #name)

ssize_t write(int handle, const void *from, size_t size) {
    REAL(ssize_t, write, int, const void *, size_t);
    return fails_on(handle) ? -1 : real(handle, from, size);
}

ssize_t writev(int handle, const struct iovec *parts, int number) {
    REAL(ssize_t, writev, int, const struct iovec *, int);
    return fails_on(handle) ? -1 : real(handle, parts, number);
}

int fsync(int handle) {
    REAL(int, fsync, int);
    return fails_on(handle) ? -1 : real(handle);
}

int ftruncate(int handle, off_t size) {
    REAL(int, ftruncate, int, off_t);
    return fails_on(handle) ? -1 : real(handle, size);
}

int ftruncate64(int handle, off64_t size) {
    REAL(int, ftruncate64, int, off64_t);
    return fails_on(handle) ? -1 : real(handle, size);
}

int rename(const char *from, const char *to) {
    REAL(int, rename, const char *, const char *);
    return beneath(to) && fails() ? -1 : real(from, to);
}

int renameat2(int from_at, const char *from, int to_at, const char *to, unsigned flags) {
    REAL(int, renameat2, int, const char *, int, const char *, unsigned);
    return beneath(to) && fails() ? -1 : real(from_at, from, to_at, to, flags);
}

#define OPENING(name)                                                                  \
    int name(const char *path, int flags, ...) {                                       \
        REAL(int, name, const char *, int, ...);                                       \
        mode_t mode = 0;                                                               \
        if (flags & O_CREAT) {                                                         \
            va_list rest;                                                              \
            va_start(rest, flags);                                                     \
            mode = va_arg(rest, mode_t);                                               \
            va_end(rest);                                                              \
        }                                                                              \
        if ((flags & O_ACCMODE) != O_RDONLY && beneath(path) && fails()) return -1;    \
        return real(path, flags, mode);                                                \
    }

OPENING(open)
OPENING(open64)
