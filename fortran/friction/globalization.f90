!> Globalisation of Newton's method: damped steps and cuts of the classification parameter
!> (docs/theory/friction.md, "Globalisation"). Where nothing resists a load, `fix_in_stick` of hc_load_constraints fixes
!> nodes, as in the direct method.
module hc_globalization
  use hc_precision, only: wp
  use hc_options, only: newton_options_t
  implicit none
  private

  public :: globalization_t

  !> Progress of an iteration.
  type :: globalization_t
    !> Factor of the classification parameter, the smaller the worse the iteration goes
    real(wp) :: share_of_r = 1.0_wp
    !> Shear tractions solved for, and the least of their residuals R_t
    integer, private :: n_sweep = 0
    real(wp), private :: best = huge(1.0_wp)
    !> Share of the next step that is taken if that residual does not fall
    real(wp), private :: damping = 1.0_wp
  contains
    !> Cut the classification parameter where nodes are fixed in stick
    procedure :: cut
    !> Share of a step to take
    procedure :: step_share
  end type globalization_t

contains

  !> Cut the classification parameter.
  pure subroutine cut(self, factor, options)
    class(globalization_t), intent(inout) :: self
    !> Factor of the cut
    real(wp), intent(in) :: factor
    type(newton_options_t), intent(in) :: options

    self%share_of_r = max(factor*self%share_of_r, options%least_share_of_r)
  end subroutine cut

  !> Choose the share of a step to take, 1 or less: a residual that does not fall oscillates.
  subroutine step_share(self, residual, options, share)
    class(globalization_t), intent(inout) :: self
    !> Residual R_t after the whole step
    real(wp), intent(in) :: residual
    type(newton_options_t), intent(in) :: options
    !> What lies between the old and the new iterate carries the same loads
    real(wp), intent(out) :: share

    self%n_sweep = self%n_sweep + 1
    if (mod(self%n_sweep, options%sweeps_per_cut) == 0) then
      call self%cut(0.5_wp, options)
      self%best = huge(1.0_wp)
    end if
    if (self%n_sweep <= options%undamped_sweeps .or. &
        residual <= max(options%stalled_share*self%best, options%settled_residual)) then
      self%best = min(self%best, residual)
      self%damping = options%first_damping
      share = 1.0_wp
    else
      share = self%damping
      self%damping = max(options%damping_factor*self%damping, options%least_damping)
    end if
  end subroutine step_share

end module hc_globalization
