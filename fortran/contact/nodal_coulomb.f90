!> Coulomb's law with a coefficient for each node, a power of the pressure and a bound of the traction.
!>
!> The traction of a node is at most
!>
!>     b(p) = min(mu p^k, q_max),
!>
!> mu that of the node: (F15) of docs/theory/friction.md. Where mu p > q_max it is Tresca's law; a power other than one is that
!> of an interface whose own limit c_t psi^m_t is not proportional to its pressure c_n psi^m_n (J. T. Oden and J. A. C. Martins,
!> Comput. Methods Appl. Mech. Eng. 52, 1985; (11.20) of the dissertation): mu = c_t c_n^-k with k = m_t/m_n. The rest
!> follows from the disc of this radius (hc_disc_law).
module hc_nodal_coulomb
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite, ieee_is_nan
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_disc_law, only: disc_law_t
  implicit none
  private

  public :: nodal_coulomb_t

  !> Friction that differs from node to node, with a bound.
  type, extends(disc_law_t) :: nodal_coulomb_t
    !> Coefficient of friction of each node [Pa^(1 - k)]
    real(wp), allocatable :: coefficient(:)
    !> Bound of the shear traction q_max [Pa]
    real(wp) :: shear_limit = huge(1.0_wp)
    !> Power k of the pressure
    real(wp) :: power = 1.0_wp
    !> Largest coefficient of all ranks; negative: of these nodes
    real(wp), private :: largest = -1.0_wp
  contains
    procedure :: resists, is_bounded, check, strength_of_disc, find_bounds, find_slopes, find_disc
    procedure :: find_nodal_values, set_nodal_values
    !> Return whether the bound is proportional to the pressure
    procedure, private :: is_linear
    !> Largest coefficient
    procedure, private :: strongest
  end type nodal_coulomb_t

contains

  !> Return whether any node has friction.
  pure logical function resists(self)
    class(nodal_coulomb_t), intent(in) :: self

    resists = self%strongest() > 0.0_wp
  end function resists

  !> Return whether nodes may slip: always, once the coefficients are set.
  pure logical function is_bounded(self)
    class(nodal_coulomb_t), intent(in) :: self

    is_bounded = allocated(self%coefficient)
  end function is_bounded

  !> Refuse coefficients, a bound or a power that make no sense on the window.
  pure subroutine check(self, n_node, error)
    class(nodal_coulomb_t), intent(in) :: self
    integer, intent(in) :: n_node
    type(error_t), allocatable, intent(out) :: error

    if (size(self%coefficient) /= n_node) then
      call raise(error, status%invalid_input, 'coefficients of friction: one for each node of the window expected')
    else if (.not. all(ieee_is_finite(self%coefficient))) then
      call raise(error, status%invalid_input, 'coefficients of friction: finite numbers expected at all nodes')
    else if (any(self%coefficient < 0.0_wp)) then
      call raise(error, status%invalid_input, 'coefficients of friction: numbers of at least 0 expected at all nodes')
    else if (ieee_is_nan(self%shear_limit) .or. .not. self%shear_limit > 0.0_wp) then
      call raise(error, status%invalid_input, 'bound of the shear traction: a number above 0 expected')
    else if (.not. (ieee_is_finite(self%power) .and. self%power > 0.0_wp)) then
      call raise(error, status%invalid_input, 'power of the pressure in the friction limit: a finite number above 0 expected')
    end if
  end subroutine check

  !> Return whether the bound is proportional to the pressure.
  pure logical function is_linear(self)
    class(nodal_coulomb_t), intent(in) :: self

    is_linear = abs(self%power - 1.0_wp) <= 0.0_wp
  end function is_linear

  !> Compute the largest bound over the largest pressure; 1 without a pressure, if they are not proportional.
  pure real(wp) function strength_of_disc(self, p_max) result(strength)
    class(nodal_coulomb_t), intent(in) :: self
    real(wp), intent(in) :: p_max

    strength = self%strongest()
    if (.not. self%is_linear()) then
      strength = merge(strength*max(p_max, tiny(1.0_wp))**(self%power - 1.0_wp), 1.0_wp, p_max > 0.0_wp)
    end if
    if (strength*p_max > self%shear_limit) strength = self%shear_limit/p_max
  end function strength_of_disc

  !> Compute min(mu p^k, q_max) of a row.
  pure subroutine find_bounds(self, first, p, bound)
    class(nodal_coulomb_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in), contiguous :: p(:)
    real(wp), intent(out), contiguous :: bound(:)

    bound = max(p, 0.0_wp)
    if (.not. self%is_linear()) bound = bound**self%power
    bound = min(self%coefficient(first:first + size(p) - 1)*bound, self%shear_limit)
  end subroutine find_bounds

  !> Differentiate the bounds of a row by the pressure.
  pure subroutine find_slopes(self, first, p, bound)
    class(nodal_coulomb_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in), contiguous :: p(:)
    real(wp), intent(out), contiguous :: bound(:)

    bound = self%coefficient(first:first + size(p) - 1)
    if (.not. self%is_linear()) bound = bound*merge(max(p, tiny(1.0_wp))**(self%power - 1.0_wp), 0.0_wp, p > 0.0_wp)
    where (bound*p > self%shear_limit)
      bound = 0.0_wp
    else where
      bound = self%power*bound
    end where
  end subroutine find_slopes

  !> Compute b(p), above zero where there is pressure, also on a node without friction: it is in contact and slips.
  pure subroutine find_disc(self, first, p, slope, pressed)
    class(nodal_coulomb_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in), contiguous :: p(:)
    real(wp), intent(out) :: slope
    real(wp), intent(out), contiguous :: pressed(:)

    slope = 1.0_wp
    call self%find_bounds(first, p, pressed)
    pressed = merge(max(pressed, tiny(1.0_wp)), 0.0_wp, p > 0.0_wp)
  end subroutine find_disc

  !> Return the largest coefficient.
  pure real(wp) function strongest(self)
    class(nodal_coulomb_t), intent(in) :: self

    strongest = self%largest
    if (strongest < 0.0_wp) strongest = maxval(self%coefficient)
  end function strongest

  !> Return the coefficients.
  pure subroutine find_nodal_values(self, values)
    class(nodal_coulomb_t), intent(in) :: self
    real(wp), allocatable, intent(out) :: values(:)

    values = self%coefficient
  end subroutine find_nodal_values

  !> Set the coefficients.
  pure subroutine set_nodal_values(self, values, largest)
    class(nodal_coulomb_t), intent(inout) :: self
    real(wp), intent(in) :: values(:), largest

    self%coefficient = values
    self%largest = largest
  end subroutine set_nodal_values

end module hc_nodal_coulomb
