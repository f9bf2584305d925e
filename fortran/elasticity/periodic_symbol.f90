!> Fourier symbols of the five kernels on a window that repeats, to 4e-11 of that of K1 on equilateral cells.
!>
!> A pyramid repeats with the window, and its displacements with it. Their transform is the alias sum over reciprocal vectors
!> G = (i, j) of the product of three sinc functions with that of the kernel, as in hc_lattice_symbol. With half phases
!> h1 = theta1/2 + pi i, h2 = theta2/2 + pi j and h3 = h2 - h1 the signs of the sines cancel:
!>
!>     symbol = sum over G of s1 s2 s3/(h1 h2 h3) F(h1, h2), s_q = sin(theta_q/2).
!>
!> The terms fall off like |G|^-4 only, but those of large G change little with the phases. Few terms are summed at each
!> frequency. The sum of all others is s1 s2 s3 times a smooth function of the phases, but on the lines of G where a factor
!> 1/h_q becomes large; their sums have that factor for themselves. Each of these functions is a Chebyshev interpolant. Its
!> values are sums over hexagons |i|, |j| <= 3 k + 1, |i + j| <= 5 k + 2, extrapolated to all G in powers of 1/(k + 1/2). Their
!> sides cross the lines at right angles in the index, where terms of large 1/h_q cancel in pairs, and k is odd: were it any
!> number, the last row across the line h3 would hold points now on it, now beside it.
!>
!> The mean of all displacements is infinite under a mean traction. Displacements are those from the mean planes: the symbols
!> at zero vanish.
!>
!> Equations: docs/theory/periodic.md, (G1) to (G4).
module hc_periodic_symbol
  use hc_precision, only: wp, pi
  implicit none
  private

  public :: periodic_symbols_t, new_periodic_symbols, sinc, n_symbol

  !> Symbols of K1, K_xx, K_xy, and those of K_x and K_y over i.
  integer, parameter :: n_symbol = 5
  !> Lines of G where a half phase may vanish: its number, and its shift in half turns.
  integer, parameter :: line(2, 4) = reshape([1, 0, 2, 0, 3, 0, 3, 1], [2, 4]), n_line = size(line, 2)
  !> Degree of the interpolants, in each phase.
  integer, parameter :: degree = 13
  !> Numbers k of the hexagons.
  integer, parameter :: hexagon(7) = [1, 3, 5, 7, 9, 11, 13]
  !> Frequencies of a column that are computed together.
  integer, parameter :: stride = 64

  !> Symbols on one window.
  type :: periodic_symbols_t
    private
    !> Basis vectors as columns [m], area of a cell [m^2]
    real(wp) :: basis(2, 2) = 0.0_wp, area = 0.0_wp
    !> Columns and rows of the window, and the largest |i| and |j| of the terms that are summed
    integer :: length(2) = 0, near(2) = 0
    !> Chebyshev coefficients (theta1, theta2, none or line, symbol, sign of theta2)
    real(wp), allocatable :: coefficient(:, :, :, :, :)
  contains
    !> Symbols at all frequencies of a column
    procedure :: column
  end type periodic_symbols_t

contains

  !> Set up the symbols on a window.
  pure subroutine new_periodic_symbols(self, basis, length, n)
    !> Symbols to be set up
    type(periodic_symbols_t), intent(out) :: self
    !> Basis vectors as columns [m]
    real(wp), intent(in) :: basis(2, 2)
    !> Number of columns and rows of the window
    integer, intent(in) :: length(2)
    !> How many of them
    integer, intent(in) :: n
    real(wp), dimension(0:degree, 0:degree) :: wave, value
    real(wp) :: node(0:degree), side(2), weight(size(hexagon)), x(size(hexagon))
    real(wp), allocatable :: at_nodes(:, :, :, :, :)
    integer, allocatable :: terms(:, :)
    integer :: a, b, half, k, m, stretch

    self%basis = basis
    self%area = basis(1, 1)*basis(2, 2) - basis(2, 1)*basis(1, 2)
    self%length = length
    side = norm2(basis, dim=1)
    self%near = max(1, ceiling(1.5_wp*side/side(2:1:-1)))
    ! as much larger as the cells are longer one way
    stretch = ceiling(maxval(side)/minval(side) - 0.01_wp)
    x = 1.0_wp/(stretch*hexagon + 0.5_wp)
    weight = [(product(x/(x - x(m)), mask=[(k /= m, k=1, size(x))]), m=1, size(x))]
    node = [(cos(pi*(a + 0.5_wp)/(degree + 1)), a=0, degree)]
    do a = 0, degree
      wave(a, :) = cos(a*pi*([(real(b, wp), b=0, degree)] + 0.5_wp)/(degree + 1))*merge(1.0_wp, 2.0_wp, a == 0)/(degree + 1)
    end do
    terms = terms_beyond(self%near, stretch*hexagon)
    allocate (at_nodes(0:degree, 0:degree, 0:n_line, n, 2))
    allocate (self%coefficient(0:degree, 0:degree, 0:n_line, n, 2))
    do half = 1, 2
      do b = 0, degree
        call sum_beyond(self, 0.5_wp*pi*(1.0_wp + node), 0.5_wp*pi*(node(b) + merge(1.0_wp, -1.0_wp, half == 1)), &
                        terms, weight, at_nodes(:, b, :, :, half))
      end do
    end do
    do half = 1, 2
      do m = 1, n
        do k = 0, n_line
          value = at_nodes(:, :, k, m, half)
          self%coefficient(:, :, k, m, half) = matmul(matmul(wave, value), transpose(wave))
        end do
      end do
    end do
  end subroutine new_periodic_symbols

  !> List the terms that are not summed at each frequency: i, j, the first hexagon that they lie in, and the line or 0 (4, terms).
  pure function terms_beyond(near, hexagons) result(terms)
    !> Largest |i| and |j| of the others
    integer, intent(in) :: near(2)
    !> Numbers of the hexagons
    integer, intent(in) :: hexagons(:)
    integer, allocatable :: terms(:, :)
    integer :: i, j, k, m, n, last, shift(3)

    last = 3*hexagons(size(hexagons)) + 1
    allocate (terms(4, (2*last + 1)**2))
    n = 0
    do j = -last, last
      do i = -last, last
        if (abs(i) <= near(1) .and. abs(j) <= near(2)) cycle
        m = findloc(3*hexagons + 1 >= max(abs(i), abs(j)) .and. 5*hexagons + 2 >= abs(i + j), .true., dim=1)
        if (m == 0) cycle
        shift = [i, j, j - i]
        do k = n_line, 1, -1
          if (shift(line(1, k)) == line(2, k)) exit
        end do
        n = n + 1
        terms(:, n) = [i, j, m, k]
      end do
    end do
    terms = terms(:, :n)
  end function terms_beyond

  !> Sum these terms at phases with the same second one, without sines and without the factors that lines have for themselves.
  pure subroutine sum_beyond(self, theta1, theta2, terms, weight, total)
    type(periodic_symbols_t), intent(in) :: self
    !> Phases
    real(wp), intent(in) :: theta1(:), theta2
    !> The terms, and the weights of the sums over hexagons
    integer, intent(in) :: terms(:, :)
    real(wp), intent(in) :: weight(:)
    !> Sums: by the first phase, off the lines and on each (phase, 0:n_line, symbol)
    real(wp), intent(out) :: total(:, 0:, :)
    real(wp) :: part(size(theta1), size(total, 3), 0:n_line, size(weight))
    real(wp) :: half(size(theta1), 3), f(size(theta1), size(total, 3)), factor(size(theta1))
    integer :: m, t, s

    part = 0.0_wp
    do t = 1, size(terms, 2)
      associate (i => terms(1, t), j => terms(2, t), hexagon => terms(3, t), k => terms(4, t))
        half(:, 1) = 0.5_wp*theta1 + pi*i
        half(:, 2) = 0.5_wp*theta2 + pi*j
        half(:, 3) = half(:, 2) - half(:, 1)
        call responses(self, half(:, 1), half(:, 2), f)
        if (k > 0) half(:, line(1, k)) = 1.0_wp
        factor = 1.0_wp/(half(:, 1)*half(:, 2)*half(:, 3))
        do s = 1, size(f, 2)
          part(:, s, k, hexagon) = part(:, s, k, hexagon) + factor*f(:, s)
        end do
      end associate
    end do
    total = 0.0_wp
    do m = 1, size(weight)
      do s = 1, size(total, 3)
        total(:, :, s) = total(:, :, s) + sum(weight(m:))*part(:, s, :, m)
      end do
    end do
  end subroutine sum_beyond

  !> Compute the transforms F of the kernels at wave vectors.
  pure subroutine responses(self, h1, h2, f)
    type(periodic_symbols_t), intent(in) :: self
    !> Half phases
    real(wp), intent(in), contiguous :: h1(:), h2(:)
    !> Transforms (wave vector, symbol)
    real(wp), intent(out), contiguous :: f(:, :)
    real(wp), dimension(size(h1)) :: d1, d2, square

    ! the wave vectors times half the area of a cell
    d1 = h1*self%basis(2, 2) - h2*self%basis(2, 1)
    d2 = h2*self%basis(1, 1) - h1*self%basis(1, 2)
    square = d1**2 + d2**2
    f(:, 1) = pi*self%area/sqrt(square)
    if (size(f, 2) == 1) return
    f(:, 2) = f(:, 1)*d2**2/square
    f(:, 3) = -f(:, 1)*d1*d2/square
    f(:, 4) = -pi*self%area*d1/square
    f(:, 5) = -pi*self%area*d2/square
  end subroutine responses

  !> Compute the symbols at all frequencies with the same first index.
  pure subroutine column(self, f, symbol)
    class(periodic_symbols_t), intent(in) :: self
    !> First index, from 0 to half the number of columns
    integer, intent(in) :: f
    !> Symbols by the second index (0:number of rows - 1, symbol); K1, K_xx, K_xy, those of K_x and K_y over i [m]
    real(wp), intent(out) :: symbol(0:, :)
    real(wp) :: row(0:degree, 0:n_line, size(symbol, 2)), wave(0:degree, 1)
    integer :: first, g, k, last, m, side

    wave = chebyshev([4.0_wp*f/self%length(1) - 1.0_wp])
    do side = 1, 2
      do m = 1, size(symbol, 2)
        do k = 0, n_line
          row(:, k, m) = matmul(wave(:, 1), self%coefficient(:, :, k, m, side))
        end do
      end do
      first = merge(0, self%length(2)/2 + 1, side == 1)
      last = merge(self%length(2)/2, self%length(2) - 1, side == 1)
      do g = first, last, stride
        call piece(self, f, g, row, symbol(g:min(g + stride - 1, last), :))
      end do
    end do
    if (f == 0) symbol(0, :) = 0.0_wp
    ! frequencies that are their own opposites: the odd symbols vanish
    if (modulo(2*f, self%length(1)) == 0) then
      symbol(0, 4:) = 0.0_wp
      if (modulo(self%length(2), 2) == 0) symbol(self%length(2)/2, 4:) = 0.0_wp
    end if
  end subroutine column

  !> Compute the symbols at some frequencies that follow one another, all in the same half of a column.
  pure subroutine piece(self, f, g, row, symbol)
    type(periodic_symbols_t), intent(in) :: self
    !> First index, and the first second one
    integer, intent(in) :: f, g
    !> Chebyshev coefficients in the second phase (degree, none or line, symbol)
    real(wp), intent(in) :: row(0:, 0:, :)
    !> Symbols (frequency, symbol)
    real(wp), intent(out) :: symbol(:, :)
    real(wp) :: half(size(symbol, 1), 3), sine(size(symbol, 1), 3), factor(size(symbol, 1), 0:n_line)
    real(wp) :: wave(0:degree, size(symbol, 1)), here(size(symbol, 1), size(symbol, 2)), shifted(size(symbol, 1))
    real(wp) :: second(size(symbol, 1), -self%near(2):self%near(2))
    real(wp) :: third(size(symbol, 1), -sum(self%near):sum(self%near))
    integer :: i, j, k, m, shift

    shift = merge(0, self%length(2), 2*g <= self%length(2))
    half(:, 1) = pi*f/self%length(1)
    half(:, 2) = pi*[(g + k - shift, k=0, size(symbol, 1) - 1)]/self%length(2)
    ! the term of zero has no value: any other frequency in its place
    if (f == 0 .and. g == 0) half(1, 2) = 0.5_wp*pi
    half(:, 3) = half(:, 2) - half(:, 1)
    sine = sin(half)
    factor(:, 0) = product(sine, dim=2)
    do k = 1, n_line
      associate (q => line(1, k))
        factor(:, k) = sine(:, modulo(q, 3) + 1)*sine(:, modulo(q + 1, 3) + 1)*over(sine(:, q), half(:, q), line(2, k))
      end associate
    end do
    wave = chebyshev(4.0_wp*half(:, 2)/pi - merge(1.0_wp, -1.0_wp, shift == 0))
    do m = 1, size(symbol, 2)
      symbol(:, m) = 0.0_wp
      do k = 0, n_line
        symbol(:, m) = symbol(:, m) + factor(:, k)*matmul(row(:, k, m), wave)
      end do
    end do
    do j = lbound(second, 2), ubound(second, 2)
      second(:, j) = over(sine(:, 2), half(:, 2), j)
    end do
    do j = lbound(third, 2), ubound(third, 2)
      third(:, j) = over(sine(:, 3), half(:, 3), j)
    end do
    do j = -self%near(2), self%near(2)
      do i = -self%near(1), self%near(1)
        call responses(self, half(:, 1) + pi*i, half(:, 2) + pi*j, here)
        shifted = over(sine(:, 1), half(:, 1), i)*second(:, j)*third(:, j - i)
        do m = 1, size(symbol, 2)
          symbol(:, m) = symbol(:, m) + shifted*here(:, m)
        end do
      end do
    end do
  end subroutine piece

  !> Divide sines of half phases by these, shifted by half turns.
  elemental real(wp) function over(sine, half, turns)
    real(wp), intent(in) :: sine, half
    integer, intent(in) :: turns
    logical :: limit
    real(wp) :: x

    x = half + pi*turns
    limit = abs(x) < 1.0e-8_wp
    over = merge(real(1 - 2*modulo(turns, 2), wp), sine/merge(1.0_wp, x, limit), limit)
  end function over

  !> Compute the Chebyshev polynomials of all degrees (degree, argument).
  pure function chebyshev(x) result(t)
    real(wp), intent(in) :: x(:)
    real(wp) :: t(0:degree, size(x))
    integer :: k

    t(0, :) = 1.0_wp
    t(1, :) = x
    do k = 2, degree
      t(k, :) = 2.0_wp*x*t(k - 1, :) - t(k - 2, :)
    end do
  end function chebyshev

  !> Compute sin(x)/x.
  elemental real(wp) function sinc(x)
    real(wp), intent(in) :: x

    if (abs(x) < 1.0e-8_wp) then
      sinc = 1.0_wp
    else
      sinc = sin(x)/x
    end if
  end function sinc

end module hc_periodic_symbol
