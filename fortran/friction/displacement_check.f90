!> Check of the displacements of an iterate with friction against its tractions, for builds with assertions.
!>
!> Equations: docs/theory/friction.md, (F1).
module hc_displacement_check
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_contact_state, only: normal, along_x, along_y
  use hc_friction_iterate, only: friction_iterate_t
  implicit none
  private

  public :: check_displacements

contains

  !> Fail if `w`, `closing` and `u` are not the displacements by the tractions, which every step of the algorithm
  !> preserves. The products are not counted.
  subroutine check_displacements(now, error)
    !> Iterate
    type(friction_iterate_t), intent(inout) :: now
    !> Allocated on failure
    type(error_t), allocatable, intent(out) :: error
    real(wp) :: applications, largest, sinking
    logical :: agreed
    real(wp), allocatable :: q(:), moved(:), by_pressure(:), w(:), u(:)

    associate (n => size(now%p), rounding => now%problem%options%newton%displacement_rounding)
      allocate (moved(3*n), by_pressure(3*n), source=0.0_wp)
      applications = now%operators%flexibility%applications
      call now%operators%apply([normal], now%p, [normal, along_x, along_y], by_pressure, error)
      if (allocated(error)) return
      if (.not. now%shear_feels_pressure) by_pressure(n + 1:) = 0.0_wp
      call now%operators%apply([along_x, along_y], now%q, [normal, along_x, along_y], moved, error)
      if (allocated(error)) return
      u = by_pressure(n + 1:) + moved(n + 1:)
      if (now%cut) then
        allocate (q(2*n))
        call now%project_to_cone(q)
        call now%operators%apply([along_x, along_y], q, [normal], moved(:n), error)
        if (allocated(error)) return
      end if
      if (.not. now%pressure_feels_shear) moved(:n) = 0.0_wp
      w = by_pressure(:n) + merge(moved(:n), 0.0_wp, now%joint)
      if (now%joint) moved(:n) = 0.0_wp
      now%operators%flexibility%applications = applications
      ! nodes in stick move little: pressure and shear traction cancel there
      associate (space => now%operators%space)
        sinking = space%max_abs(w)
        largest = space%max_abs(by_pressure(n + 1:)) + space%max_abs(moved(n + 1:))
        agreed = agree(now%w, w, rounding*sinking + now%rounding) .and. &
                 agree(now%closing, moved(:size(now%closing)), rounding*sinking) .and. &
                 (agree(now%u, u, rounding*largest + now%rounding) .or. .not. now%problem%friction%resists())
        if (space%number(merge(0, 1, agreed)) > 0) then
          call raise(error, status%no_convergence, 'friction: displacements are not those of the tractions')
        end if
      end associate
    end associate
  end subroutine check_displacements

  !> Return whether two fields agree but for rounding errors.
  pure logical function agree(one, other, rounding)
    real(wp), intent(in) :: one(:), other(:)
    !> Largest difference by rounding errors
    real(wp), intent(in) :: rounding

    agree = all(abs(one - other) <= rounding)
  end function agree

end module hc_displacement_check
