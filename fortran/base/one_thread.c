/* Parallel regions of one thread, without the library of OpenMP.

   GNU's makes a team for each of them, about 0.4 us, and wakes nobody at each barrier, about 0.2 us: a quarter of the time
   of a load step on 31 x 31 nodes. Outside of all regions what shares work out or waits is legal and costs next to
   nothing, so that the body can be called as it is. The linker lets calls of GOMP_parallel come here first (--wrap,
   fortran/meson.build); where it cannot, this file is not used. */
#include <omp.h>

void __real_GOMP_parallel(void (*body)(void *), void *data, unsigned threads, unsigned flags);
void __wrap_GOMP_parallel(void (*body)(void *), void *data, unsigned threads, unsigned flags);

void __wrap_GOMP_parallel(void (*body)(void *), void *data, unsigned threads, unsigned flags)
{
  /* 0: as many as OpenMP takes */
  int alone = threads == 1 || (threads == 0 && omp_get_max_threads() == 1);

  /* inside another region its threads would share the work of this one */
  if (alone && omp_get_level() == 0)
    body(data);
  else
    __real_GOMP_parallel(body, data, threads, flags);
}
