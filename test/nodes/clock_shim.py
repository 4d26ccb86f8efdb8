"""A process whose system clock is set by a file: below every library of it, by a C library that is preloaded.

The file holds a signed 64-bit number of ns, in this machine's byte order, that is added to the system clock.
Waits until an instant of that clock last as they would: longer where it is set back meanwhile.
"""

from __future__ import annotations

import subprocess
import sys

SOURCE = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/syscall.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

static volatile const long long *added;

__attribute__((constructor)) static void begin(void) {
    const char *path = getenv("SHIMMED_CLOCK");
    int file = path ? open(path, O_RDONLY | O_CLOEXEC) : -1;
    void *place = file < 0 ? MAP_FAILED : mmap(0, 8, PROT_READ, MAP_SHARED, file, 0);
    if (file >= 0) close(file);
    if (place != MAP_FAILED) added = place;
}

static void add(struct timespec *t, long long ns) {
    t->tv_sec += ns / 1000000000LL;
    t->tv_nsec += ns % 1000000000LL;
    if (t->tv_nsec < 0) { t->tv_nsec += 1000000000LL; t->tv_sec -= 1; }
    if (t->tv_nsec >= 1000000000LL) { t->tv_nsec -= 1000000000LL; t->tv_sec += 1; }
}

int clock_gettime(clockid_t clock, struct timespec *t) {
    int failed = (int)syscall(SYS_clock_gettime, clock, t);
    if (!failed && added && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE)) {
        add(t, *added);
    }
    return failed;
}

int gettimeofday(struct timeval *restrict t, void *restrict zone) {
    struct timespec now;
    (void)zone;
    int failed = clock_gettime(CLOCK_REALTIME, &now);
    if (!failed && t) { t->tv_sec = now.tv_sec; t->tv_usec = now.tv_nsec / 1000; }
    return failed;
}

time_t time(time_t *t) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    if (t) *t = now.tv_sec;
    return now.tv_sec;
}

static struct timespec of_kernel(const struct timespec *deadline) {
    struct timespec t = *deadline;
    if (added) add(&t, -*added);
    return t;
}

static int is_over(const struct timespec *deadline) {
    struct timespec now;
    clock_gettime(CLOCK_REALTIME, &now);
    if (now.tv_sec != deadline->tv_sec) return now.tv_sec > deadline->tv_sec;
    return now.tv_nsec >= deadline->tv_nsec;
}

int pthread_cond_timedwait(pthread_cond_t *condition, pthread_mutex_t *mutex, const struct timespec *t) {
    static int (*real)(pthread_cond_t *, pthread_mutex_t *, const struct timespec *);
    if (!real) *(void **)&real = dlsym(RTLD_NEXT, "pthread_cond_timedwait");
    if (condition->__data.__wrefs & 2) return real(condition, mutex, t);  /* glibc: by CLOCK_MONOTONIC */
    for (;;) {
        struct timespec deadline = of_kernel(t);
        int result = real(condition, mutex, &deadline);
        if (result != ETIMEDOUT || is_over(t)) return result;
    }
}

int sem_timedwait(sem_t *semaphore, const struct timespec *t) {
    static int (*real)(sem_t *, const struct timespec *);
    if (!real) *(void **)&real = dlsym(RTLD_NEXT, "sem_timedwait");
    for (;;) {
        struct timespec deadline = of_kernel(t);
        int result = real(semaphore, &deadline);
        if (!result || errno != ETIMEDOUT || is_over(t)) return result;
    }
}
"""


def preload(folder, step):
    """Return the environment of a process whose clock a file sets, below every library of it."""
    source, library = folder / "shim.c", folder / "shim.so"
    source.write_text(SOURCE)
    subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", library, source, "-ldl"], check=True)
    return {"LD_PRELOAD": str(library), "SHIMMED_CLOCK": str(step)}


def set_clock(step, by):
    """Write how far the clock is off, ns, in place: the process has the file mapped."""
    with step.open("r+b" if step.exists() else "wb") as file:
        file.write(by.to_bytes(8, sys.byteorder, signed=True))
