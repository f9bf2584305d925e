// Transforms of complex lines by pocketfft. Included once for each kind of processor, inside a namespace, so without a guard.
//
// pocketfft computes with vectors only on several lines at once. One line of n = L m numbers is therefore transformed as L
// lines of m, with x(L k + l) in lane l; the last pass of Cooley and Tukey (1965) joins them,
//   X(k + m q) = sum over l of exp(-2 pi i l q/L) exp(-2 pi i l k/n) Y_l(k).
// A line has the same bits in any company.

template <typename T, std::size_t L>
struct lanes_of {
  typedef T type __attribute__((vector_size(L * sizeof(T))));
  typedef T unaligned __attribute__((vector_size(L * sizeof(T)), aligned(alignof(T)), may_alias));
};

template <typename T>
class lines {
 public:
  lines(std::size_t length, std::size_t count)
      : n_(length), count_(count), lanes_(most_lanes(length)), m_(length / lanes_), short_(m_) {
    if (lanes_ == 8) set_twiddle<8>();
    if (lanes_ == 4) set_twiddle<4>();
  }

  void transform(const T *in, T *out) const {
    if (lanes_ == 8) return in_lanes<8>(in, out);
    if (lanes_ == 4) return in_lanes<4>(in, out);
    std::copy(in, in + 2 * n_ * count_, out);
    for (std::size_t line = 0; line < count_; ++line, out += 2 * n_)
      short_.exec(reinterpret_cast<complex<T> *>(out), T(1), pocketfft::detail::FORWARD);
  }

 private:
  template <typename V>
  using complex = pocketfft::detail::cmplx<V>;

  std::size_t n_, count_, lanes_, m_;
  pocketfft::detail::pocketfft_c<T> short_;
  std::vector<T> twiddle_;

  // exp(-2 pi i l k/n) as L real parts and L imaginary ones, in the order in which they are read
  template <std::size_t L>
  void set_twiddle() {
    const pocketfft::detail::sincos_2pibyn<T> unit(n_);
    for (std::size_t k = 0; k < m_; k += L)
      for (std::size_t j = 1; j < L; ++j)
        for (std::size_t lane = 0; lane < 2 * L; ++lane) {
          const auto w = unit[place<L>(j) * std::min(k + place<L>(lane % L), m_ - 1)];
          twiddle_.push_back(lane < L ? w.r : -w.i);
        }
  }

  static std::size_t most_lanes(std::size_t n) {
    if (sizeof(T) == 4 && n % 8 == 0) return 8;
    return n % 4 == 0 ? 4 : 1;
  }

  using four = typename lanes_of<T, 4>::type;
  using eight = typename lanes_of<T, 8>::type;
  // numbers in 16 bytes, within which processors shuffle at once
  static constexpr std::size_t piece = 16 / sizeof(T);

  // Numbers in the order of `place`, from pairs r i r i ...
  static void unzip(four &r, four &i) {
    const four a = r, b = i;
    if (piece == 2) {
      r = __builtin_shufflevector(a, b, 0, 4, 2, 6);
      i = __builtin_shufflevector(a, b, 1, 5, 3, 7);
    } else {
      r = __builtin_shufflevector(a, b, 0, 2, 4, 6);
      i = __builtin_shufflevector(a, b, 1, 3, 5, 7);
    }
  }
  static void unzip(eight &r, eight &i) {
    const eight a = r, b = i;
    r = __builtin_shufflevector(a, b, 0, 2, 8, 10, 4, 6, 12, 14);
    i = __builtin_shufflevector(a, b, 1, 3, 9, 11, 5, 7, 13, 15);
  }

  // Interleave the lower halves of all pieces, and the upper ones; undoes `unzip`.
  static void zip(four &r, four &i) {
    const four a = r, b = i;
    if (piece == 2) {
      r = __builtin_shufflevector(a, b, 0, 4, 2, 6);
      i = __builtin_shufflevector(a, b, 1, 5, 3, 7);
    } else {
      r = __builtin_shufflevector(a, b, 0, 4, 1, 5);
      i = __builtin_shufflevector(a, b, 2, 6, 3, 7);
    }
  }
  static void zip(eight &r, eight &i) {
    const eight a = r, b = i;
    r = __builtin_shufflevector(a, b, 0, 8, 1, 9, 4, 12, 5, 13);
    i = __builtin_shufflevector(a, b, 2, 10, 3, 11, 6, 14, 7, 15);
  }

  // The lower halves of two vectors, and the upper ones.
  static void halves(four &lower, four &upper) {
    const four a = lower, b = upper;
    lower = __builtin_shufflevector(a, b, 0, 1, 4, 5);
    upper = __builtin_shufflevector(a, b, 2, 3, 6, 7);
  }
  static void halves(eight &lower, eight &upper) {
    const eight a = lower, b = upper;
    lower = __builtin_shufflevector(a, b, 0, 1, 2, 3, 8, 9, 10, 11);
    upper = __builtin_shufflevector(a, b, 4, 5, 6, 7, 12, 13, 14, 15);
  }

  // Number in a lane after `unzip`.
  template <std::size_t L>
  static constexpr std::size_t place(std::size_t lane) {
    return L == piece ? lane : lane / piece * (piece / 2) + lane % (piece / 2) + lane % piece / (piece / 2) * (L / 2);
  }

  template <typename V, std::size_t L>
  static void transpose(V (&row)[L]) {
    for (V *of = row; of < row + L; of += piece) {
      if (piece == 4) {
        zip(of[0], of[2]);
        zip(of[1], of[3]);
      }
      zip(of[0], of[1]);
      if (piece == 4) zip(of[2], of[3]);
    }
    if (L > piece)
      for (std::size_t p = 0; p < piece; ++p) halves(row[p], row[p + piece]);
  }

  template <typename U>
  static U load(const T *from) { return *reinterpret_cast<const U *>(from); }

  // Y to exp(-i pi/2) Y
  template <typename V>
  static complex<V> turned(const complex<V> &y) { return complex<V>(y.i, -y.r); }

  template <typename V>
  static void dft4(complex<V> &a, complex<V> &b, complex<V> &c, complex<V> &d) {
    const complex<V> s = a + c, t = a - c, u = b + d, v = turned(b - d);
    a = s + u;
    b = t + v;
    c = s - u;
    d = t - v;
  }

  template <typename V>
  static void dft(complex<V> (&z)[4]) { dft4(z[0], z[1], z[2], z[3]); }

  template <typename V>
  static void dft(complex<V> (&z)[8]) {
    const T h = T(0.70710678118654752440L);
    dft4(z[0], z[2], z[4], z[6]);
    dft4(z[1], z[3], z[5], z[7]);
    const complex<V> even[4] = {z[0], z[2], z[4], z[6]};
    const complex<V> odd[4] = {z[1], complex<V>((z[3].r + z[3].i) * h, (z[3].i - z[3].r) * h), turned(z[5]),
                               complex<V>((z[7].i - z[7].r) * h, (z[7].r + z[7].i) * -h)};
    for (int q = 0; q < 4; ++q) {
      z[q] = even[q] + odd[q];
      z[q + 4] = even[q] - odd[q];
    }
  }

  template <std::size_t L>
  void in_lanes(const T *in, T *out) const {
    pocketfft::detail::arr<complex<typename lanes_of<T, L>::type>> y(m_);
    for (std::size_t line = 0; line < count_; ++line, in += 2 * n_, out += 2 * n_) {
      take<L>(in, y.data());
      short_.exec(y.data(), T(1), pocketfft::detail::FORWARD);
      join<L>(y.data(), out);
    }
  }

  template <std::size_t L, typename V>
  void take(const T *in, complex<V> *y) const {
    using U = typename lanes_of<T, L>::unaligned;
    for (std::size_t k = 0; k < m_; ++k, in += 2 * L) {
      V r = load<U>(in), i = load<U>(in + L);
      unzip(r, i);
      y[k] = complex<V>(r, i);
    }
  }

  template <std::size_t L, typename V>
  void join(const complex<V> *y, T *out) const {
    using U = typename lanes_of<T, L>::unaligned;
    const T *w = twiddle_.data();
    for (std::size_t k = 0; k < m_; k += L) {
      const std::size_t width = std::min(L, m_ - k);
      V re[L], im[L];
      for (std::size_t j = 0; j < L; ++j) {
        const std::size_t row = k + std::min(place<L>(j), width - 1);
        re[j] = y[row].r;
        im[j] = y[row].i;
      }
      transpose(re);
      transpose(im);
      complex<V> z[L];
      z[0] = complex<V>(re[0], im[0]);
      for (std::size_t j = 1; j < L; ++j, w += 2 * L) {
        const V r = load<U>(w), i = load<U>(w + L);
        z[place<L>(j)] = complex<V>(re[j] * r - im[j] * i, re[j] * i + im[j] * r);
      }
      dft(z);
      for (std::size_t q = 0; q < L; ++q) {
        T *to = out + 2 * (k + m_ * q);
        V r = z[q].r, i = z[q].i;
        zip(r, i);
        if (width == L) {
          *reinterpret_cast<U *>(to) = r;
          *reinterpret_cast<U *>(to + L) = i;
        } else {
          for (std::size_t j = 0; j < 2 * width; ++j) to[j] = j < L ? r[j] : i[j - L];
        }
      }
    }
  }
};
