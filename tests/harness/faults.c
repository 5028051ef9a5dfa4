/* Fails one call to the file system, ends the process at one, or notes them all.

   Loaded into the program with LD_PRELOAD. Looked at are calls on paths below MIRRORSTATS_FAULT_ROOT alone:

   MIRRORSTATS_FAULT      KIND:N:ERRNO      the N-th call of a kind (from 1) fails with an errno; `*` is any kind that changes
                          KIND:N:ERRNO:on   something. With `on` so do all later ones. ERRNO 0 ends the process instead.
                          memory:N:ERRNO    the N-th allocation of 4 KiB or more fails; with N = 0 they are counted alone.
   MIRRORSTATS_FAULT_LOG  a file that every call is added to, a line each; `tests/harness/faults.rs` reads it.

   A write that fails has written half of its bytes: no caller may rely on the contrary. Programs that the program starts
   are left alone. Calls are made one at a time, so that the log has their order. */

#define _GNU_SOURCE
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
#include <sys/syscall.h>
#include <sys/uio.h>
#include <unistd.h>

static pthread_mutex_t one_at_a_time = PTHREAD_MUTEX_INITIALIZER;
static char root[PATH_MAX], kind_to_fail[16];
static int log_fd = -1, is_on, error_to_give;
static long number_to_fail, seen;

__attribute__((constructor)) static void start(void) {
    const char *folder = getenv("MIRRORSTATS_FAULT_ROOT"), *fault = getenv("MIRRORSTATS_FAULT");
    const char *log = getenv("MIRRORSTATS_FAULT_LOG");
    char on[4] = "";
    unsetenv("LD_PRELOAD");
    if (folder) snprintf(root, sizeof root, "%s", folder);
    if (fault) {
        if (sscanf(fault, "%15[^:]:%ld:%d:%3s", kind_to_fail, &number_to_fail, &error_to_give, on) < 3) _exit(99);
        is_on = !strcmp(on, "on");
    }
    if (log) log_fd = syscall(SYS_openat, AT_FDCWD, log, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666);
}

/* The number of allocations, for a process that ends in order. */
__attribute__((destructor)) static void end(void) {
    char line[64];
    if (strcmp(kind_to_fail, "memory") || log_fd < 0) return;
    int length = snprintf(line, sizeof line, "memory\t%ld\n", seen);
    syscall(SYS_write, log_fd, line, length);
}

extern void *__libc_malloc(size_t), *__libc_calloc(size_t, size_t), *__libc_realloc(void *, size_t), *__libc_memalign(size_t, size_t);

/* Whether this allocation fails. Allocates nothing, and takes no lock: allocations happen in every call. */
static int is_refused(size_t size) {
    if (size < 4096 || strcmp(kind_to_fail, "memory")) return 0;
    return __atomic_add_fetch(&seen, 1, __ATOMIC_RELAXED) == number_to_fail;
}

void *malloc(size_t size) { return is_refused(size) ? (errno = ENOMEM, (void *)0) : __libc_malloc(size); }
void *calloc(size_t count, size_t size) { return is_refused(count * size) ? (errno = ENOMEM, (void *)0) : __libc_calloc(count, size); }
void *realloc(void *old, size_t size) { return is_refused(size) ? (errno = ENOMEM, (void *)0) : __libc_realloc(old, size); }
int posix_memalign(void **out, size_t alignment, size_t size) {
    *out = is_refused(size) ? 0 : __libc_memalign(alignment, size);
    return *out ? 0 : ENOMEM;
}
void *aligned_alloc(size_t alignment, size_t size) { return is_refused(size) ? (errno = ENOMEM, (void *)0) : __libc_memalign(alignment, size); }

/* The absolute path of what a call is about, without `.` and doubled slashes; 0 if it is not below the folder. */
static int path_of(int folder, const char *path, char *out) {
    char whole[2 * PATH_MAX];
    if (!root[0] || !path) return 0;
    if (path[0] == '/') {
        snprintf(whole, sizeof whole, "%s", path);
    } else {
        char link[64], base[PATH_MAX];
        if (folder == AT_FDCWD) snprintf(link, sizeof link, "/proc/self/cwd");
        else snprintf(link, sizeof link, "/proc/self/fd/%d", folder);
        ssize_t length = syscall(SYS_readlinkat, AT_FDCWD, link, base, sizeof base - 1);
        if (length < 0) return 0;
        base[length] = 0;
        snprintf(whole, sizeof whole, "%s/%s", base, path);
    }
    char *to = out;
    for (const char *from = whole; *from && to - out < PATH_MAX - 1;) {
        if (from[0] == '/' && (from[1] == '/' || (from[1] == '.' && (from[2] == '/' || !from[2])))) {
            from += from[1] == '/' ? 1 : 2;
        } else {
            *to++ = *from++;
        }
    }
    while (to > out + 1 && to[-1] == '/') to--;
    *to = 0;
    size_t length = strlen(root);
    return !strncmp(out, root, length) && (out[length] == '/' || !out[length]);
}

static int path_of_open(int fd, char *out) {
    char link[64], path[PATH_MAX];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t length = syscall(SYS_readlinkat, AT_FDCWD, link, path, sizeof path - 1);
    if (length < 0) return 0;
    path[length] = 0;
    /* A pipe has a name without a folder. */
    return path[0] == '/' && path_of(AT_FDCWD, path, out);
}

static void put(const char *text, size_t length) {
    while (length > 0) {
        ssize_t written = syscall(SYS_write, log_fd, text, length);
        if (written <= 0) _exit(97);
        text += written;
        length -= written;
    }
}

static void note(const char *format, ...) {
    char line[3 * PATH_MAX];
    va_list values;
    if (log_fd < 0) return;
    va_start(values, format);
    int length = vsnprintf(line, sizeof line, format, values);
    va_end(values);
    put(line, length);
}

/* Whether this call is to fail. A call that changes nothing counts for its own kind alone. */
static int fails(const char *kind, int changes, const char *path) {
    if (!kind_to_fail[0] || !(strcmp(kind, kind_to_fail) ? changes && !strcmp("*", kind_to_fail) : 1)) return 0;
    seen++;
    if (seen != number_to_fail && !(is_on && seen > number_to_fail)) return 0;
    note("fault\t%s\t%s\n", kind, path);
    if (error_to_give == 0) {
        syscall(SYS_kill, getpid(), SIGKILL);
        for (;;) pause();
    }
    errno = error_to_give;
    return 1;
}

#define BEGIN pthread_mutex_lock(&one_at_a_time)
#define END(value) do { int kept = errno; pthread_mutex_unlock(&one_at_a_time); errno = kept; return value; } while (0)

static unsigned long inode(int fd) {
    struct stat about;
    return fstat(fd, &about) ? 0 : about.st_ino;
}

static int opened(int folder, const char *given, int flags, mode_t mode) {
    char path[PATH_MAX];
    if (!path_of(folder, given, path)) return syscall(SYS_openat, folder, given, flags, mode);
    BEGIN;
    struct stat before;
    int is_there = !fstatat(folder, given, &before, 0), changes = (flags & O_CREAT && !is_there) || flags & O_TRUNC;
    if (fails("open", changes, path)) END(-1);
    int fd = syscall(SYS_openat, folder, given, flags, mode);
    note("open\t%s\n", path);
    if (fd >= 0 && flags & O_CREAT && !is_there) note("create\t%s\t%lu\n", path, inode(fd));
    if (fd >= 0 && flags & O_TRUNC && is_there) note("truncate\t%lu\t0\n", inode(fd));
    END(fd);
}

#define MODE mode_t mode = 0; if (flags & (O_CREAT | __O_TMPFILE)) { va_list rest; va_start(rest, flags); mode = va_arg(rest, mode_t); va_end(rest); }
int open(const char *path, int flags, ...) { MODE return opened(AT_FDCWD, path, flags, mode); }
int open64(const char *path, int flags, ...) { MODE return opened(AT_FDCWD, path, flags, mode); }
int openat(int folder, const char *path, int flags, ...) { MODE return opened(folder, path, flags, mode); }
int openat64(int folder, const char *path, int flags, ...) { MODE return opened(folder, path, flags, mode); }

static ssize_t written(int fd, const char *bytes, size_t length, off_t at) {
    char path[PATH_MAX];
    if (!path_of_open(fd, path)) return at < 0 ? syscall(SYS_write, fd, bytes, length) : syscall(SYS_pwrite64, fd, bytes, length, at);
    BEGIN;
    struct stat about;
    int is_failing = fails("write", 1, path), given = errno;
    fstat(fd, &about);
    off_t start = at >= 0 ? at : fcntl(fd, F_GETFL) & O_APPEND ? about.st_size : lseek(fd, 0, SEEK_CUR);
    if (is_failing) length /= 2;
    ssize_t done = at < 0 ? syscall(SYS_write, fd, bytes, length) : syscall(SYS_pwrite64, fd, bytes, length, at);
    if (done > 0 && log_fd >= 0) {
        char *hex = __libc_malloc(2 * done + 1);
        for (ssize_t i = 0; i < done; i++) sprintf(hex + 2 * i, "%02x", (unsigned char)bytes[i]);
        note("write\t%lu\t%ld\t", (unsigned long)about.st_ino, (long)start);
        put(hex, 2 * done);
        put("\n", 1);
        free(hex);
    }
    if (is_failing) { errno = given; END(-1); }
    END(done);
}

ssize_t write(int fd, const void *bytes, size_t length) { return written(fd, bytes, length, -1); }
ssize_t pwrite64(int fd, const void *bytes, size_t length, off64_t at) { return written(fd, bytes, length, at); }
ssize_t pwrite(int fd, const void *bytes, size_t length, off_t at) { return written(fd, bytes, length, at); }
ssize_t writev(int fd, const struct iovec *parts, int count) {
    char path[PATH_MAX];
    if (!path_of_open(fd, path)) return syscall(SYS_writev, fd, parts, count);
    /* A call may write less than it was given. */
    for (int i = 0; i < count; i++) if (parts[i].iov_len) return written(fd, parts[i].iov_base, parts[i].iov_len, -1);
    return 0;
}

/* Whoever finds these missing writes instead. */
ssize_t copy_file_range(int from, off64_t *at, int fd, off64_t *to, size_t length, unsigned flags) {
    char path[PATH_MAX];
    if (!path_of_open(fd, path)) return syscall(SYS_copy_file_range, from, at, fd, to, length, flags);
    errno = ENOSYS;
    return -1;
}
ssize_t sendfile64(int fd, int from, off64_t *at, size_t length) {
    char path[PATH_MAX];
    if (!path_of_open(fd, path)) return syscall(SYS_sendfile, fd, from, at, length);
    errno = ENOSYS;
    return -1;
}

static int synced(int fd, int call) {
    char path[PATH_MAX];
    if (!path_of_open(fd, path)) return syscall(call, fd);
    BEGIN;
    if (fails("fsync", 1, path)) END(-1);
    struct stat about;
    fstat(fd, &about);
    /* The model keeps what is synchronised: the disk need not. */
    if (S_ISDIR(about.st_mode)) note("sync_folder\t%s\n", path);
    else note("sync\t%lu\n", (unsigned long)about.st_ino);
    END(0);
}
int fsync(int fd) { return synced(fd, SYS_fsync); }
int fdatasync(int fd) { return synced(fd, SYS_fdatasync); }

static int cut(int fd, off_t length) {
    char path[PATH_MAX];
    if (!path_of_open(fd, path)) return syscall(SYS_ftruncate, fd, length);
    BEGIN;
    if (fails("truncate", 1, path)) END(-1);
    int result = syscall(SYS_ftruncate, fd, length);
    if (!result) note("truncate\t%lu\t%ld\n", inode(fd), (long)length);
    END(result);
}
int ftruncate(int fd, off_t length) { return cut(fd, length); }
int ftruncate64(int fd, off64_t length) { return cut(fd, length); }

static int renamed(int a, const char *from, int b, const char *to, unsigned flags) {
    char old[PATH_MAX], new[PATH_MAX];
    if (!path_of(b, to, new) || !path_of(a, from, old)) return syscall(SYS_renameat2, a, from, b, to, flags);
    BEGIN;
    if (fails("rename", 1, old)) END(-1);
    int result = syscall(SYS_renameat2, a, from, b, to, flags);
    if (!result) note("rename\t%s\t%s\n", old, new);
    END(result);
}
int rename(const char *from, const char *to) { return renamed(AT_FDCWD, from, AT_FDCWD, to, 0); }
int renameat(int a, const char *from, int b, const char *to) { return renamed(a, from, b, to, 0); }
int renameat2(int a, const char *from, int b, const char *to, unsigned flags) { return renamed(a, from, b, to, flags); }

static int removed(int folder, const char *given, int flags) {
    char path[PATH_MAX];
    if (!path_of(folder, given, path)) return syscall(SYS_unlinkat, folder, given, flags);
    BEGIN;
    struct stat before;
    int changes = !fstatat(folder, given, &before, AT_SYMLINK_NOFOLLOW);
    if (fails("unlink", changes, path)) END(-1);
    int result = syscall(SYS_unlinkat, folder, given, flags);
    if (!result) note("unlink\t%s\n", path);
    END(result);
}
int unlink(const char *path) { return removed(AT_FDCWD, path, 0); }
int unlinkat(int folder, const char *path, int flags) { return removed(folder, path, flags); }
int rmdir(const char *path) { return removed(AT_FDCWD, path, AT_REMOVEDIR); }

static int made(int folder, const char *given, mode_t mode) {
    char path[PATH_MAX];
    if (!path_of(folder, given, path)) return syscall(SYS_mkdirat, folder, given, mode);
    BEGIN;
    if (fails("mkdir", 1, path)) END(-1);
    int result = syscall(SYS_mkdirat, folder, given, mode);
    if (!result) note("mkdir\t%s\n", path);
    END(result);
}
int mkdir(const char *path, mode_t mode) { return made(AT_FDCWD, path, mode); }
int mkdirat(int folder, const char *path, mode_t mode) { return made(folder, path, mode); }

static int linked(int a, const char *from, int b, const char *to, int flags) {
    char old[PATH_MAX], new[PATH_MAX];
    if (!path_of(b, to, new) || !path_of(a, from, old)) return syscall(SYS_linkat, a, from, b, to, flags);
    BEGIN;
    if (fails("link", 1, new)) END(-1);
    int result = syscall(SYS_linkat, a, from, b, to, flags);
    if (!result) note("link\t%s\t%s\n", old, new);
    END(result);
}
int link(const char *from, const char *to) { return linked(AT_FDCWD, from, AT_FDCWD, to, 0); }
int linkat(int a, const char *from, int b, const char *to, int flags) { return linked(a, from, b, to, flags); }
