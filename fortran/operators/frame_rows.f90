!> Passes over nodes that follow each other in a row, between components along x and y and those in the frames of the nodes.
!>
!> A node in contact has a frame: its direction e, and t = (-e_2, e_1). Arguments have explicit shapes and do not overlap, so
!> that the compiler takes several nodes at a time; conditions are factors of 0 or 1, or it would compute in branches.
module hc_frame_rows
  use hc_precision, only: wp, sp
  implicit none
  private

  public :: turn_row, plane_row, add_springs_row, take_off_row, slip_compliance_row
  public :: slip_to_plane, stick_to_plane, add_turned

  !> Squares below this count as nothing.
  real(wp), parameter :: nothing = 1.0e-200_wp

contains

  !> Turn components along x and y into the frames, or back.
  pure subroutine turn_row(n, direction, x, y)
    !> Number of nodes, and their directions e
    integer, intent(in) :: n
    real(wp), intent(in) :: direction(2, n)
    !> The components
    real(wp), intent(inout) :: x(n), y(n)
    real(wp) :: turned
    integer :: i

    !$omp simd private(turned)
    do i = 1, n
      turned = -direction(2, i)*x(i) + direction(1, i)*y(i)
      y(i) = direction(1, i)*x(i) + direction(2, i)*y(i)
      x(i) = turned
    end do
  end subroutine turn_row

  !> Compute components along x and y from those in the frames.
  pure subroutine plane_row(n, direction, along_t, along_e, x, y)
    !> Number of nodes, and their directions e
    integer, intent(in) :: n
    real(wp), intent(in) :: direction(2, n)
    !> Components in the frames, and along x and y
    real(wp), intent(in) :: along_t(n), along_e(n)
    real(wp), intent(inout) :: x(n), y(n)
    integer :: i

    !$omp simd
    do i = 1, n
      x(i) = -direction(2, i)*along_t(i) + direction(1, i)*along_e(i)
      y(i) = direction(1, i)*along_t(i) + direction(2, i)*along_e(i)
    end do
  end subroutine plane_row

  !> Turn displacements into the frames, and add the stretch of the springs.
  pure subroutine add_springs_row(n, direction, compliance, along_t, x, y)
    !> Number of nodes, their directions e and the compliances of their springs
    integer, intent(in) :: n
    real(wp), intent(in) :: direction(2, n), compliance(n)
    !> Traction along t
    real(wp), intent(in) :: along_t(n)
    !> Displacement along x and y; then along t and e
    real(wp), intent(inout) :: x(n), y(n)
    real(wp) :: turned
    integer :: i

    !$omp simd private(turned)
    do i = 1, n
      turned = -direction(2, i)*x(i) + direction(1, i)*y(i) + compliance(i)*along_t(i)
      y(i) = direction(1, i)*x(i) + direction(2, i)*y(i)
      x(i) = turned
    end do
  end subroutine add_springs_row

  !> Take the stretch of the springs off displacements along t.
  pure subroutine take_off_row(n, compliance, traction, displacement, largest)
    !> Number of nodes, and compliances of their springs
    integer, intent(in) :: n
    real(wp), intent(in) :: compliance(n)
    !> Traction and displacement along t
    real(wp), intent(in) :: traction(n)
    real(wp), intent(inout) :: displacement(n)
    !> The largest stretch, of the rows before and of this one
    real(wp), intent(inout) :: largest
    integer :: i

    !$omp simd reduction(max: largest)
    do i = 1, n
      displacement(i) = displacement(i) - compliance(i)*traction(i)
      largest = max(largest, abs(compliance(i)*traction(i)))
    end do
  end subroutine take_off_row

  !> Reduce the tractions of a row by springs in series with the stiffness that each node was found to have in stick.
  pure subroutine slip_compliance_row(n, compliance, ux, uy, qx, qy)
    !> Number of nodes
    integer, intent(in) :: n
    !> Compliance of the springs, and displacements
    real(wp), intent(in) :: compliance(n), ux(n), uy(n)
    !> Tractions if all nodes stuck; then those with the springs
    real(wp), intent(inout) :: qx(n), qy(n)
    real(wp) :: moved, stretch, left, sprung
    integer :: i

    !$omp simd private(moved, stretch, left, sprung)
    do i = 1, n
      ! displacement of the spring under that traction
      stretch = compliance(i)*sqrt(qx(i)**2 + qy(i)**2)
      moved = sqrt(ux(i)**2 + uy(i)**2)
      sprung = merge(1.0_wp, 0.0_wp, stretch > 0.0_wp)
      left = sprung*(moved/max(moved + stretch, nothing)) + (1.0_wp - sprung)
      qx(i) = left*qx(i)
      qy(i) = left*qy(i)
    end do
  end subroutine slip_compliance_row

  !> Turn the displacements of slipping nodes.
  pure subroutine slip_to_plane(n, direction, along_t, x, y)
    !> Number of nodes, and their directions e
    integer, intent(in) :: n
    real(wp), intent(in) :: direction(2, n)
    !> Displacement along t, and along x and y
    real(wp), intent(in) :: along_t(n)
    real(sp), intent(inout) :: x(n), y(n)
    integer :: i

    !$omp simd
    do i = 1, n
      x(i) = real(-direction(2, i)*along_t(i), sp)
      y(i) = real(direction(1, i)*along_t(i), sp)
    end do
  end subroutine slip_to_plane

  !> Turn the displacements of sticking nodes.
  pure subroutine stick_to_plane(n, direction, factor, along_t, along_e, x, y)
    !> Number of nodes, their directions e, and a factor of the components along them
    integer, intent(in) :: n
    real(wp), intent(in) :: direction(2, n), factor
    !> Displacement along t and e, and along x and y
    real(wp), intent(in) :: along_t(n), along_e(n)
    real(sp), intent(inout) :: x(n), y(n)
    real(wp) :: e
    integer :: i

    !$omp simd private(e)
    do i = 1, n
      e = factor*along_e(i)
      x(i) = real(-direction(2, i)*along_t(i) + direction(1, i)*e, sp)
      y(i) = real(direction(1, i)*along_t(i) + direction(2, i)*e, sp)
    end do
  end subroutine stick_to_plane

  !> Add e_1 a + sign e_2 b.
  pure subroutine add_turned(n, sign, direction, a, b, total)
    !> Number of nodes
    integer, intent(in) :: n
    !> Sign, and directions e
    real(wp), intent(in) :: sign, direction(2, n)
    !> Components, and the sums to which they are added
    real(sp), intent(in) :: a(n), b(n)
    real(wp), intent(inout) :: total(n)
    integer :: i

    !$omp simd
    do i = 1, n
      total(i) = total(i) + (direction(1, i)*a(i) + sign*direction(2, i)*b(i))
    end do
  end subroutine add_turned

end module hc_frame_rows
