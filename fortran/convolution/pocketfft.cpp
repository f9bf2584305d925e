// The functions of FFTW that the library calls, by pocketfft: -Dfft=pocketfft.
//
// Names and arguments are those of fftw3.h; what the library does not ask for (strides, other directions) is not planned.
// All symbols are hidden, so that an FFTW in the same process is neither used nor replaced.

#include <algorithm>
#include <atomic>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <new>
#include <stdexcept>
#include <vector>

#define POCKETFFT_NO_MULTITHREADING
#pragma GCC visibility push(hidden)
// vectors of 32 bytes are arguments within this file only
#pragma GCC diagnostic ignored "-Wpsabi"

// Templates of different processors need different names: the linker keeps one of those that have the same.
#define pocketfft pocketfft_any
#include <pocketfft_hdronly.h>
namespace any {
#include "fft_lines.hpp"
}
#undef pocketfft

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define HC_AVX2
#pragma GCC push_options
#pragma GCC target("avx2,fma")
#undef POCKETFFT_HDRONLY_H
#undef POCKETFFT_NO_VECTORS
#undef POCKETFFT_NOINLINE
#undef POCKETFFT_RESTRICT
#define pocketfft pocketfft_avx2
#include <pocketfft_hdronly.h>
namespace avx2 {
#include "fft_lines.hpp"
}
#undef pocketfft
#pragma GCC pop_options
#endif

namespace {

template <typename T>
struct plan {
  virtual ~plan() = default;
  virtual void transform(const T *in, T *out) const = 0;
};

template <typename T, typename Lines>
struct plan_of : plan<T> {
  Lines lines;
  plan_of(std::size_t length, std::size_t count) : lines(length, count) {}
  void transform(const T *in, T *out) const override { lines.transform(in, out); }
};

// Null: no memory, or arguments that the library does not use.
template <typename T>
void *make_plan(int rank, const int *n, int count, int istride, int idist, int ostride, int odist, int sign) noexcept {
  if (rank != 1 || n[0] < 1 || istride != 1 || ostride != 1 || idist != n[0] || odist != n[0] || sign != -1) return nullptr;
  try {
#ifdef HC_AVX2
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
      return static_cast<plan<T> *>(new plan_of<T, avx2::lines<T>>(n[0], count));
    }
#endif
    return static_cast<plan<T> *>(new plan_of<T, any::lines<T>>(n[0], count));
  } catch (...) {
    return nullptr;
  }
}

}  // namespace

#define HC_FFTW(prefix, T)                                                                                          \
  extern "C" {                                                                                                      \
  void *prefix##_plan_many_dft(int rank, const int *n, int count, T *, const int *, int istride, int idist, T *,    \
                               const int *, int ostride, int odist, int sign, unsigned) noexcept {                  \
    return make_plan<T>(rank, n, count, istride, idist, ostride, odist, sign);                                      \
  }                                                                                                                 \
  void prefix##_execute_dft(const void *made, T *in, T *out) noexcept {                                             \
    static_cast<const plan<T> *>(made)->transform(in, out);                                                         \
  }                                                                                                                 \
  void prefix##_destroy_plan(void *made) noexcept { delete static_cast<plan<T> *>(made); }                          \
  }

HC_FFTW(fftw, double)
HC_FFTW(fftwf, float)
