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

  public :: lattice_symbols, symbol_1, symbol_xx, symbol_xy

  !> Order of the symbols: those of K1, K_xx and K_xy.
  integer, parameter :: symbol_1 = 1, symbol_xx = 2, symbol_xy = 3

  !> Reciprocal vectors on each side of equilateral cells; the terms fall off like |G|^-3 at least.
  integer, parameter :: n_alias = 1

contains

  !> Compute the symbols of K1, or of all three kernels, at many frequencies of a periodic grid [m].
  pure subroutine lattice_symbols(basis, length, frequency, symbol)
    !> Basis vectors as columns [m]
    real(wp), intent(in) :: basis(2, 2)
    !> Number of columns and rows of the grid
    integer, intent(in) :: length(2)
    !> Frequency indices (2, n), from 0 to length - 1
    integer, intent(in) :: frequency(:, :)
    !> Symbols of K1, K_xx and K_xy, the first or all (n, 1 or 3) [m]
    real(wp), intent(out), contiguous :: symbol(:, :)
    real(wp), parameter :: mean(3) = [1.0_wp, 0.5_wp, 0.0_wp]
    integer, allocatable :: some(:), opposite(:, :)
    real(wp), allocatable :: more(:, :)
    integer :: m

    call sum_aliases(basis, length, frequency, symbol)
    do m = 1, size(symbol, 1)
      if (any(frequency(:, m) /= 0)) cycle
      symbol(m, :) = 2.0_wp*pi*sqrt((basis(1, 1)*basis(2, 2) - basis(2, 1)*basis(1, 2))*product(real(length, wp))/pi) &
                     *mean(:size(symbol, 2))
    end do
    ! On a Nyquist row k and -k are the same frequency: a cut-off sum has to be made even.
    some = pack([(m, m=1, size(symbol, 1))], any(2*frequency == spread(length, 2, size(symbol, 1)), dim=1))
    if (size(some) == 0) return
    allocate (more(size(some), size(symbol, 2)))
    opposite = frequency(:, some)
    do m = 1, size(some)
      opposite(:, m) = merge(opposite(:, m), modulo(-opposite(:, m), length), 2*opposite(:, m) == length)
    end do
    call sum_aliases(basis, length, opposite, more)
    symbol(some, :) = 0.5_wp*(symbol(some, :) + more)
  end subroutine lattice_symbols

  !> Sum the symbols over reciprocal vectors; those of the mean are left out.
  !>
  !> The signs of the sines cancel in the product of all three: the sum over aliases is one over sines, polynomials and a
  !> root. Where a phase vanishes, one takes the place of the sine and of the phase in the term without a shift.
  pure subroutine sum_aliases(basis, length, frequency, symbol)
    !> As of `lattice_symbols`
    real(wp), intent(in) :: basis(2, 2)
    integer, intent(in) :: length(2)
    integer, intent(in) :: frequency(:, :)
    real(wp), intent(out), contiguous :: symbol(:, :)

    ! half the phases along the three directions of edges, their sines, and 1 where they vanish
    real(wp), dimension(size(symbol, 1), 3) :: half, sine, none
    ! terms of an alias, and squares of k
    real(wp), dimension(size(symbol, 1)) :: term, square
    real(wp) :: sine_1(0:length(1) - 1), cosine_1(0:length(1) - 1), sine_2(0:length(2) - 1), cosine_2(0:length(2) - 1)
    real(wp) :: area, g(3), h(3), d(3), shift(3), here(3)
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
      half(m, 1:2) = [1.0_wp, 2.0_wp]  ! any different numbers
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
  end subroutine sum_aliases

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

end module hc_lattice_symbol
