!> Functions of one variable: zeros and integrals.
!>
!> Further arguments of a function are components of an extension of the abstract type.
module hc_scalar_function
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use hc_precision, only: wp, pi
  implicit none
  private

  public :: scalar_function_t, zero_between, integral, gauss_legendre

  !> A function of one variable.
  type, abstract :: scalar_function_t
  contains
    !> Value at a point
    procedure(value_interface), deferred :: at
  end type scalar_function_t

  abstract interface
    !> Return the value of a function.
    pure function value_interface(self, x) result(value)
      import :: scalar_function_t, wp
      implicit none
      class(scalar_function_t), intent(in) :: self
      !> Where
      real(wp), intent(in) :: x
      real(wp) :: value
    end function value_interface
  end interface

  !> Points of the Gauss rule on each panel of an integral.
  integer, parameter :: n_gauss = 20

contains

  !> Find the zero of a function between two points where its signs differ; not a number if they do not.
  !>
  !> Bisection, secant and inverse quadratic interpolation: R. P. Brent, Algorithms for Minimization Without
  !> Derivatives (1973), chapter 4.
  pure real(wp) function zero_between(f, first, last, tolerance) result(b)
    !> Function
    class(scalar_function_t), intent(in) :: f
    !> Ends of the interval
    real(wp), intent(in) :: first, last
    !> Absolute error that is accepted beside four units of rounding
    real(wp), intent(in) :: tolerance

    !> Bisection alone would take as many for the longest interval of numbers.
    integer, parameter :: most_steps = 2100
    real(wp) :: a, c, fa, fb, fc, step, last_step, half, near, p, q, r, s
    integer :: i

    a = first
    b = last
    fa = f%at(a)
    fb = f%at(b)
    if (.not. (min(fa, fb) <= 0.0_wp .and. max(fa, fb) >= 0.0_wp)) then
      b = ieee_value(b, ieee_quiet_nan)
      return
    end if
    c = b
    fc = fb
    step = b - a
    last_step = step
    do i = 1, most_steps
      if ((fb > 0.0_wp) .eqv. (fc > 0.0_wp)) then
        c = a
        fc = fa
        step = b - a
        last_step = step
      end if
      if (abs(fc) < abs(fb)) then
        a = b
        b = c
        c = a
        fa = fb
        fb = fc
        fc = fa
      end if
      near = 2.0_wp*epsilon(b)*abs(b) + 0.5_wp*tolerance
      half = 0.5_wp*(c - b)
      if (abs(half) <= near .or. abs(fb) <= 0.0_wp) return
      if (abs(last_step) < near .or. abs(fa) <= abs(fb)) then
        step = half
        last_step = half
      else
        s = fb/fa
        if (abs(a - c) <= 0.0_wp) then
          p = 2.0_wp*half*s
          q = 1.0_wp - s
        else
          q = fa/fc
          r = fb/fc
          p = s*(2.0_wp*half*q*(q - r) - (b - a)*(r - 1.0_wp))
          q = (q - 1.0_wp)*(r - 1.0_wp)*(s - 1.0_wp)
        end if
        if (p > 0.0_wp) q = -q
        p = abs(p)
        if (2.0_wp*p < min(3.0_wp*half*q - abs(near*q), abs(last_step*q))) then
          last_step = step
          step = p/q
        else
          step = half
          last_step = half
        end if
      end if
      a = b
      fa = fb
      b = b + merge(step, sign(near, half), abs(step) > near)
      fb = f%at(b)
    end do
  end function zero_between

  !> Integrate a function that is smooth on each of equal panels, by Gauss's rule.
  pure real(wp) function integral(f, first, last, n_panel)
    !> Function
    class(scalar_function_t), intent(in) :: f
    !> Ends of the interval
    real(wp), intent(in) :: first, last
    !> Number of panels
    integer, intent(in) :: n_panel

    real(wp) :: node(n_gauss), weight(n_gauss), length
    integer :: i, k

    call gauss_legendre(node, weight)
    length = (last - first)/n_panel
    integral = 0.0_wp
    do k = 1, n_panel
      do i = 1, n_gauss
        integral = integral + length*weight(i)*f%at(first + length*(k - 1 + node(i)))
      end do
    end do
  end function integral

  !> Compute the nodes and weights of the Gauss-Legendre rule on [0, 1].
  !>
  !> Newton's method on the Legendre polynomial from Tricomi's estimates of its zeros.
  pure subroutine gauss_legendre(node, weight)
    !> Nodes, in ascending order
    real(wp), intent(out) :: node(:)
    !> Their weights, of sum 1
    real(wp), intent(out) :: weight(size(node))

    real(wp) :: x, before, value, after, slope
    integer :: i, k, n, step

    n = size(node)
    do i = 1, (n + 1)/2
      x = cos(pi*(i - 0.25_wp)/(n + 0.5_wp))
      do step = 1, 10
        before = 0.0_wp
        value = 1.0_wp
        do k = 1, n
          after = ((2*k - 1)*x*value - (k - 1)*before)/k
          before = value
          value = after
        end do
        slope = n*(before - x*value)/((1.0_wp - x)*(1.0_wp + x))
        x = x - value/slope
        if (abs(value/slope) <= epsilon(x)) exit
      end do
      node([i, n + 1 - i]) = 0.5_wp*[1.0_wp - x, 1.0_wp + x]
      weight([i, n + 1 - i]) = 1.0_wp/((1.0_wp - x)*(1.0_wp + x)*slope**2)
    end do
  end subroutine gauss_legendre

end module hc_scalar_function
