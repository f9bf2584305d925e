!> Coulomb friction: the traction of a node is at most mu p.
!>
!> The disc of hc_disc_law has the radius b(p) = mu p with the same coefficient at all nodes; without slip it has no bound.
!>
!> Equations: docs/theory/friction.md, (F3), (F6).
module hc_coulomb
  use, intrinsic :: ieee_arithmetic, only: ieee_is_finite
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_disc_law, only: disc_law_t
  implicit none
  private

  public :: coulomb_t

  !> Slope of the bound without slip, where pressures are in units of the largest: nothing is cut off
  real(wp), parameter :: unbounded = 1.0e100_wp

  !> Coulomb's law.
  type, extends(disc_law_t) :: coulomb_t
    !> Coefficient of friction mu; not used without slip
    real(wp) :: coefficient = 0.0_wp
    !> An infinite coefficient: no node in contact slips
    logical :: no_slip = .false.
  contains
    !> Compute the largest traction under a pressure
    procedure :: bound
    !> Return the largest traction over the pressure
    procedure :: slope
    procedure :: resists, is_bounded, check, strength_of_disc, find_bounds, find_slopes, find_disc
  end type coulomb_t

contains

  !> Compute mu p [Pa]; without slip there is no bound.
  elemental real(wp) function bound(self, pressure)
    class(coulomb_t), intent(in) :: self
    !> Pressure [Pa]
    real(wp), intent(in) :: pressure

    bound = huge(1.0_wp)
    if (.not. self%no_slip) bound = self%coefficient*max(pressure, 0.0_wp)
  end function bound

  !> Return mu; without slip a number so large that nothing is cut off, for pressures in units of the largest.
  elemental real(wp) function slope(self)
    class(coulomb_t), intent(in) :: self

    slope = unbounded
    if (.not. self%no_slip) slope = self%coefficient
  end function slope

  !> Return whether there is any friction.
  pure logical function resists(self)
    class(coulomb_t), intent(in) :: self
    resists = self%no_slip .or. self%coefficient > 0.0_wp
  end function resists

  !> Return whether any node may slip.
  pure logical function is_bounded(self)
    class(coulomb_t), intent(in) :: self
    is_bounded = .not. self%no_slip
  end function is_bounded

  !> Refuse a coefficient that is negative or no finite number.
  pure subroutine check(self, n_node, error)
    class(coulomb_t), intent(in) :: self
    integer, intent(in) :: n_node
    type(error_t), allocatable, intent(out) :: error
    logical :: sound

    sound = self%no_slip .or. ieee_is_finite(self%coefficient)
    if (sound .and. .not. self%no_slip) sound = self%coefficient >= 0.0_wp
    if (sound) return
    call raise(error, status%invalid_input, 'coefficient of friction: a finite number of at least 0 expected, or no_slip')
  end subroutine check

  !> Return mu; infinite without slip.
  pure real(wp) function strength_of_disc(self, p_max) result(strength)
    class(coulomb_t), intent(in) :: self
    real(wp), intent(in) :: p_max

    strength = huge(1.0_wp)
    if (.not. self%no_slip) strength = self%coefficient
  end function strength_of_disc

  !> Compute mu p of a row; without slip there is no bound.
  pure subroutine find_bounds(self, first, p, bound)
    class(coulomb_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in), contiguous :: p(:)
    real(wp), intent(out), contiguous :: bound(:)

    integer :: i

    if (self%no_slip) then
      bound = huge(1.0_wp)
    else
      do i = 1, size(p)
        bound(i) = self%coefficient*max(p(i), 0.0_wp)
      end do
    end if
  end subroutine find_bounds

  !> Return mu at each node of a row.
  pure subroutine find_slopes(self, first, p, bound)
    class(coulomb_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in), contiguous :: p(:)
    real(wp), intent(out), contiguous :: bound(:)

    bound = self%slope()
  end subroutine find_slopes

  !> Return mu and the pressures of a row.
  pure subroutine find_disc(self, first, p, slope, pressed)
    class(coulomb_t), intent(in) :: self
    integer, intent(in) :: first
    real(wp), intent(in), contiguous :: p(:)
    real(wp), intent(out) :: slope
    real(wp), intent(out), contiguous :: pressed(:)

    slope = self%slope()
    pressed = p
  end subroutine find_disc

end module hc_coulomb
