/* Calls of the system that Fortran lacks: locks between threads, memory that is available, owners of files. */
#include <errno.h>
#include <fcntl.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif
#include <pthread.h>
#include <stdint.h>
#include <stdio.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

/* As many as lock.f90 has names for. */
static pthread_mutex_t mutex[] = {PTHREAD_MUTEX_INITIALIZER, PTHREAD_MUTEX_INITIALIZER, PTHREAD_MUTEX_INITIALIZER,
                                  PTHREAD_MUTEX_INITIALIZER};

void hexcontact_lock(int which) { pthread_mutex_lock(&mutex[which]); }
void hexcontact_unlock(int which) { pthread_mutex_unlock(&mutex[which]); }

/* Whether so many bytes can be had at once. */
int hexcontact_can_map(size_t size)
{
  void *start = mmap(NULL, size, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);

  if (start == MAP_FAILED) return 0;
  munmap(start, size);
  return 1;
}

/* Return memory that is free to the system, where the C library knows how. */
void hexcontact_give_back(void)
{
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

/* Bytes of the stack that a new thread gets. */
size_t hexcontact_stack_size(void)
{
  pthread_attr_t attributes;
  size_t size = 0;

  if (pthread_attr_init(&attributes) != 0) return 0;
  pthread_attr_getstacksize(&attributes, &size);
  pthread_attr_destroy(&attributes);
  return size;
}

/* Open a file for reading: a regular one that, unless it is shared, nobody but this user and root may have written.
   Returns NULL with a status of spectrum_file.f90 if it cannot be had. */
FILE *hexcontact_open(const char *path, int shared, int64_t *size, int *status)
{
  enum { absent = 1, unreadable = 2, foreign = 3, open_to_others = 4 };
  struct stat state;
  FILE *stream = NULL;
  /* a FIFO must not block */
  int file = open(path, O_RDONLY | O_NONBLOCK | O_CLOEXEC);

  *status = unreadable;
  if (file < 0) {
    if (errno == ENOENT || errno == ENOTDIR) *status = absent;
    return NULL;
  }
  if (fstat(file, &state) == 0 && S_ISREG(state.st_mode)) {
    if (!shared && state.st_uid != geteuid() && state.st_uid != 0)
      *status = foreign;
    else if (!shared && (state.st_mode & (S_IWGRP | S_IWOTH)))
      *status = open_to_others;
    else
      stream = fdopen(file, "rb");
  }
  if (stream == NULL) {
    close(file);
    return NULL;
  }
  *size = state.st_size;
  *status = 0;
  return stream;
}

/* Make a file that is not there yet, which nobody else may write to, whatever the umask says. */
FILE *hexcontact_create(const char *path)
{
  int file = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, S_IRUSR | S_IWUSR | S_IRGRP | S_IROTH);
  FILE *stream = file < 0 ? NULL : fdopen(file, "wb");

  if (file >= 0 && stream == NULL) close(file);
  return stream;
}
