!> Fourier symbols of the even kernels on the lattice.
!>
!> The pyramid is a box spline over the three edge directions d_q, so that its
!> transform is cell_area * product_q sinc(k.d_q/2), and those of 1/r, x^2/r^3
!> and xy/r^3 are 2 pi/|k|, 2 pi k_y^2/|k|^3 and -2 pi k_x k_y/|k|^3. On the
!> lattice a symbol is the alias sum over reciprocal vectors,
!>
!>     symbol(k) = sum_G product_q sinc((k + G).d_q/2) * 2 pi/|k + G| [1, ...],
!>
!> in which sin((k + G).d_q/2) is that of k up to a sign. It diverges at k = 0:
!> there the kernel is summed over a disc with the area of the grid instead.
!>
!> Equations: docs/theory/preconditioner.md, (P1), (P4).
module hc_lattice_symbol
  use hc_precision, only: wp, pi
  implicit none
  private

  public :: kernel_symbols, lattice_symbols, symbol_1, symbol_xx, symbol_xy

  !> Order of the symbols: those of K1, K_xx and K_xy.
  integer, parameter :: symbol_1 = 1, symbol_xx = 2, symbol_xy = 3

  !> Reciprocal vectors on each side of equilateral cells; the terms fall off like |G|^-3 at least.
  integer, parameter :: n_alias = 1

contains

  !> Compute the symbols of K1, K_xx and K_xy at one frequency of a periodic grid [m].
  pure function kernel_symbols(basis, length, frequency) result(symbol)
    !> Basis vectors as columns [m]
    real(wp), intent(in) :: basis(2, 2)
    !> Number of columns and rows of the grid
    integer, intent(in) :: length(2)
    !> Frequency indices, of any sign
    integer, intent(in) :: frequency(2)
    real(wp) :: symbol(3)

    real(wp) :: area, theta(2)
    integer :: wrapped(2)

    area = basis(1, 1)*basis(2, 2) - basis(2, 1)*basis(1, 2)
    wrapped = modulo(frequency + (length - 1)/2, length) - (length - 1)/2
    if (all(wrapped == 0)) then
      symbol = 2.0_wp*pi*sqrt(area*product(real(length, wp))/pi)*[1.0_wp, 0.5_wp, 0.0_wp]
      return
    end if
    theta = 2.0_wp*pi*wrapped/length
    symbol = alias_sum(basis, area, theta)
    ! On a Nyquist row k and -k are the same frequency: a cut-off sum has to be made even.
    if (any(2*wrapped == length)) then
      where (2*wrapped /= length) theta = -theta
      symbol = 0.5_wp*(symbol + alias_sum(basis, area, theta))
    end if
  end function kernel_symbols

  !> Compute the symbols of K1, or of all three kernels, at many frequencies of a periodic grid [m].
  !>
  !> The signs of the sines cancel in the product of all three: the sum over aliases is one over sines, polynomials and a
  !> root. Where a phase vanishes, one takes the place of the sine and of the phase in the term without a shift.
  pure subroutine lattice_symbols(basis, length, frequency, symbol)
    !> Basis vectors as columns [m]
    real(wp), intent(in) :: basis(2, 2)
    !> Number of columns and rows of the grid
    integer, intent(in) :: length(2)
    !> Frequency indices (2, n), from 0 to length - 1
    integer, intent(in) :: frequency(:, :)
    !> Symbols in the order of `kernel_symbols`, the first or all (n, 1 or 3) [m]
    real(wp), intent(out), contiguous :: symbol(:, :)

    ! half the phases along the three directions of edges, their sines, and 1 where they vanish
    real(wp), dimension(size(symbol, 1), 3) :: half, sine, none
    ! terms of an alias, and squares of k
    real(wp), dimension(size(symbol, 1)) :: term, square
    real(wp) :: sine_1(0:length(1) - 1), cosine_1(0:length(1) - 1), sine_2(0:length(2) - 1), cosine_2(0:length(2) - 1)
    real(wp) :: area, g(3), h(3), d(3), shift(3), here(3), all_symbols(3)
    integer :: m, i, j, f(2), low(2), most(2)

    area = basis(1, 1)*basis(2, 2) - basis(2, 1)*basis(1, 2)
    ! (|k| area/2)^2 = g1 half1^2 + g2 half1 half2 + g3 half2^2
    g = [dot_product(basis(:, 2), basis(:, 2)), -2.0_wp*dot_product(basis(:, 1), basis(:, 2)), &
         dot_product(basis(:, 1), basis(:, 1))]
    call half_angles(length(1), sine_1, cosine_1)
    call half_angles(length(2), sine_2, cosine_2)
    do m = 1, size(symbol, 1)
      f = frequency(:, m)
      low = f - merge(length, 0, 2*f > length)
      half(m, 1:2) = pi*low/length
      sine(m, :) = [sine_1(f(1)), sine_2(f(2)), sine_2(f(2))*cosine_1(f(1)) - cosine_2(f(2))*sine_1(f(1))]
      none(m, :) = merge(1.0_wp, 0.0_wp, [low(1) == 0, low(2) == 0, low(1)*length(2) == low(2)*length(1)])
      if (any(low /= 0)) cycle
      half(m, 1:2) = [1.0_wp, 2.0_wp]  ! any different numbers: see below
      none(m, :) = 0.0_wp
    end do
    where (none > 0.0_wp) sine = 0.0_wp
    symbol = 0.0_wp
    most = aliases(basis)
    do j = -most(2), most(2)
      do i = -most(1), most(1)
        shift = pi*[i, j, j - i]
        here = merge(1.0_wp, 0.0_wp, [i, j, j - i] == 0)
        do m = 1, size(symbol, 1)
          h = [half(m, 1) + shift(1), half(m, 2) + shift(2), half(m, 2) - half(m, 1) + shift(3)]
          d = h + none(m, :)*(1.0_wp - h)
          square(m) = h(1)*(g(1)*h(1) + g(2)*h(2)) + g(3)*h(2)*h(2)
          term(m) = (sine(m, 1) + none(m, 1)*here(1))*(sine(m, 2) + none(m, 2)*here(2)) &
                    *(sine(m, 3) + none(m, 3)*here(3))/(d(1)*d(2)*d(3)*sqrt(square(m)))
          symbol(m, symbol_1) = symbol(m, symbol_1) + term(m)
        end do
        if (size(symbol, 2) == 1) cycle
        do m = 1, size(symbol, 1)
          associate (h1 => half(m, 1) + shift(1), h2 => half(m, 2) + shift(2))
            d(1) = h1*basis(2, 2) - h2*basis(2, 1)
            d(2) = h2*basis(1, 1) - h1*basis(1, 2)
          end associate
          symbol(m, symbol_xx) = symbol(m, symbol_xx) + term(m)/square(m)*d(2)*d(2)
          symbol(m, symbol_xy) = symbol(m, symbol_xy) - term(m)/square(m)*d(1)*d(2)
        end do
      end do
    end do
    symbol = pi*area*symbol
    ! the mean, and frequencies that are their own opposite
    do m = 1, size(symbol, 1)
      f = frequency(:, m)
      if (any(f /= 0) .and. all(2*f /= length)) cycle
      all_symbols = kernel_symbols(basis, length, f)
      symbol(m, :) = all_symbols(:size(symbol, 2))
    end do
  end subroutine lattice_symbols

  !> Compute the sines and cosines of half the phases of all frequencies, taken from (-pi, pi].
  pure subroutine half_angles(n, sine, cosine)
    !> Length
    integer, intent(in) :: n
    real(wp), intent(out) :: sine(0:n - 1), cosine(0:n - 1)
    real(wp) :: half
    integer :: f

    do f = 0, n - 1
      half = pi*merge(f - n, f, 2*f > n)/n
      sine(f) = sin(half)
      cosine(f) = cos(half)
    end do
  end subroutine half_angles

  !> Return the reciprocal vectors on each side, as far in both directions: more along the longer side of a cell.
  pure function aliases(basis) result(most)
    !> Basis vectors as columns [m]
    real(wp), intent(in) :: basis(2, 2)
    integer :: most(2)

    associate (side => norm2(basis, dim=1))
      most = n_alias*max(1, nint(side/side(2:1:-1)))
    end associate
  end function aliases

  !> Sum over reciprocal vectors; theta = k.basis in (-pi, pi].
  pure function alias_sum(basis, area, theta) result(total)
    !> Basis vectors as columns [m]
    real(wp), intent(in) :: basis(2, 2)
    !> Cell area [m^2]
    real(wp), intent(in) :: area
    !> Phases along the two basis vectors
    real(wp), intent(in) :: theta(2)
    real(wp) :: total(3)

    real(wp) :: phase(2), k(2), half(3), sine(3), weight, k_squared
    integer :: i, j, most(2)

    sine = [sin(0.5_wp*theta(1)), sin(0.5_wp*theta(2)), sin(0.5_wp*(theta(2) - theta(1)))]
    most = aliases(basis)
    total = 0.0_wp
    do j = -most(2), most(2)
      do i = -most(1), most(1)
        phase = theta + 2.0_wp*pi*[i, j]
        ! k from its products with the basis vectors
        k = [phase(1)*basis(2, 2) - phase(2)*basis(2, 1), phase(2)*basis(1, 1) - phase(1)*basis(1, 2)]/area
        half = 0.5_wp*[phase(1), phase(2), phase(2) - phase(1)]
        weight = sinc_ratio(sine(1), half(1), i)*sinc_ratio(sine(2), half(2), j)*sinc_ratio(sine(3), half(3), j - i)
        k_squared = dot_product(k, k)
        total = total + weight*2.0_wp*pi/sqrt(k_squared)*[1.0_wp, k(2)**2/k_squared, -k(1)*k(2)/k_squared]
      end do
    end do
  end function alias_sum

  !> Compute sinc(half) from the sine of the phase before it was shifted by shift*pi.
  elemental real(wp) function sinc_ratio(sine, half, shift)
    !> Sine of half the unshifted phase
    real(wp), intent(in) :: sine
    !> Half the shifted phase
    real(wp), intent(in) :: half
    !> Number of half turns between them
    integer, intent(in) :: shift

    if (abs(half) < 1.0e-8_wp) then
      sinc_ratio = 1.0_wp
    else
      sinc_ratio = merge(sine, -sine, modulo(shift, 2) == 0)/half
    end if
  end function sinc_ratio

end module hc_lattice_symbol
