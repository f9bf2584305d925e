!> Steps of an iteration for frictionless contact: direction and length.
!>
!> Equations: docs/theory/normal_contact.md, (N3) to (N5), (N7), (N8).
module hc_normal_directions
  use hc_precision, only: wp, sp
  use hc_projected_cg, only: conjugate_gradient_t
  use hc_normal_iterate, only: normal_iterate_t
  use hc_normal_rows, only: residual_row, sum_row, projected_row, direction_row, dot_single
  implicit none
  private

  public :: find_residual, projected_step, searched_step, next_direction, next_sprung_direction, curvature, find_sprung_step

contains

  !> Compute r = approach - h - w on the active nodes.
  subroutine find_residual(now)
    !> Iterate
    type(normal_iterate_t), intent(inout) :: now
    integer :: row, k

    !$omp parallel do schedule(static) num_threads(now%level%space%threads)
    do row = 1, size(now%p, 2)
      do k = 1, now%n_run(row)
        associate (from => now%run(1, k, row), to => now%run(2, k, row))
          call residual_row(to - from + 1, 1.0_wp/now%w_unit, now%approach, now%level%initial_gap(from:to, row), &
                            now%w(from:to, row), now%active(from:to, row), now%r(from:to, row, 1))
        end associate
      end do
    end do
    !$omp end parallel do
  end subroutine find_residual

  !> Add up a field over the active nodes, and its product with another one.
  subroutine sum_active(now, field, total, other, product)
    !> Iterate
    type(normal_iterate_t), intent(in) :: now
    !> The field (n_col, n_row, 1), and its sum
    real(sp), intent(in), contiguous :: field(:, :, :)
    real(wp), intent(out) :: total
    !> Another one, and the sum of the products; absent: none
    real(sp), intent(in), contiguous, optional :: other(:, :, :)
    real(wp), intent(out), optional :: product
    real(wp), dimension(size(now%p, 2)) :: part, part_of_product
    integer :: row, k

    !$omp parallel do schedule(static) num_threads(now%level%space%threads)
    do row = 1, size(now%p, 2)
      part(row) = 0.0_wp
      part_of_product(row) = 0.0_wp
      do k = 1, now%n_run(row)
        associate (from => now%run(1, k, row), to => now%run(2, k, row))
          if (present(other)) then
            call sum_row(to - from + 1, field(from:to, row, 1), now%active(from:to, row), part(row), other(from:to, row, 1), &
                         part_of_product(row))
          else
            call sum_row(to - from + 1, field(from:to, row, 1), now%active(from:to, row), part(row))
          end if
        end associate
      end do
    end do
    !$omp end parallel do
    total = now%level%space%total(part)
    if (present(product)) product = now%level%space%total(part_of_product)
  end subroutine sum_active

  !> Compute d = max(p + c z, 0) - p on the active nodes, -p elsewhere.
  subroutine projected_step(now)
    !> Iterate
    type(normal_iterate_t), intent(inout) :: now
    real(wp), dimension(size(now%p, 2)) :: part, punch
    real(wp) :: mean, step_length
    real(sp) :: lack
    integer :: row, k

    associate (options => now%level%options, space => now%level%space)
      step_length = options%normal%step_length
      if (now%level%lattice%slenderness() > options%preconditioner%slender) step_length = options%normal%slender_step
      mean = 0.0_wp
      if (now%by_load) then
        call sum_active(now, now%z, mean)
        mean = mean/now%punch_sum
      end if
      call cut(now, step_length, step_length*mean, part, punch)
      if (.not. space%total(part) > 0.0_wp) then
        ! all nodes were projected to p = 0
        now%d(:, :, 1) = now%d(:, :, 1) + merge(1.0_sp, 0.0_sp, now%active)
        part = count(now%active, dim=1)
      end if
      ! the load that was cut off is added along the punch, which changes the approach alone
      if (.not. now%by_load) return
      lack = real((now%pressures/now%p_unit - space%total(part))/now%punch_sum, sp)
      !$omp parallel do schedule(static) num_threads(space%threads)
      do row = 1, size(now%p, 2)
        do k = 1, now%n_run(row)
          associate (from => now%run(1, k, row), to => now%run(2, k, row))
            now%d(from:to, row, 1) = now%d(from:to, row, 1) + lack*now%punch(from:to, row)
          end associate
        end do
      end do
      !$omp end parallel do
    end associate
  end subroutine projected_step

  !> Compute the step d to max(p + length (z + share of the last step), 0) on the active nodes and to zero elsewhere, conjugate to
  !> the last step before the cut.
  !>
  !> The change of a prescribed load by the cut is subtracted along the punch before it, so that there is no tension, (N8).
  subroutine searched_step(now, length, curved, fall)
    !> Iterate
    type(normal_iterate_t), intent(inout) :: now
    !> Length of the step before the cut
    real(wp), intent(in) :: length
    !> d^T K d; on entry d and K d are those of the last step. 0: there is none
    real(wp), intent(in) :: curved
    !> Fall of the energy along the step by its length, -g^T d; 0: much less than without the cut
    real(wp), intent(out) :: fall
    !> Newton's method for the part along the punch, and the error of the load that is left to rounding
    integer, parameter :: max_cuts = 12
    real(wp), parameter :: rounding = 1.0e-10_wp
    !> Share of the steepness before the cut
    real(wp), parameter :: least_share = 0.1_wp
    real(wp), dimension(size(now%p, 2)) :: part, punch
    real(wp) :: mean, along_kd, off, lack, uncut
    real(sp) :: back
    integer :: row, k, try

    call sum_active(now, now%z, mean, now%kd, along_kd)
    if (now%by_load) mean = mean/now%punch_sum
    if (.not. now%by_load) mean = 0.0_wp
    back = 0.0_sp
    if (curved > 0.0_wp) back = max(real(-along_kd/curved, sp), 0.0_sp)
    !$omp parallel do schedule(static) num_threads(now%level%space%threads)
    do row = 1, size(now%p, 2)
      part(row) = 0.0_wp
      do k = 1, now%n_run(row)
        associate (from => now%run(1, k, row), to => now%run(2, k, row))
          where (now%active(from:to, row))
            now%z(from:to, row, 1) = now%z(from:to, row, 1) + back*now%d(from:to, row, 1)
          else where
            now%z(from:to, row, 1) = 0.0_sp
          end where
          part(row) = part(row) + dot_single(to - from + 1, now%r(from:to, row, 1), now%z(from:to, row, 1))
        end associate
      end do
    end do
    !$omp end parallel do
    uncut = length*now%level%space%total(part)
    off = length*mean
    do try = 1, max_cuts
      call cut(now, length, off, part, punch)
      if (.not. now%by_load) exit
      lack = now%level%space%total(part) - now%pressures/now%p_unit
      if (abs(lack) <= rounding*now%pressures/now%p_unit) exit
      off = off + lack/merge(now%level%space%total(punch), now%punch_sum, now%level%space%total(punch) > 0.0_wp)
    end do
    fall = steepness(now)
    if (.not. fall > least_share*max(uncut, 0.0_wp)) fall = 0.0_wp
  end subroutine searched_step

  !> Compute d = max(p + length z - off u, 0) - p on the active nodes, u the punch under a prescribed load, and -p elsewhere.
  subroutine cut(now, length, off, part, punch)
    type(normal_iterate_t), intent(inout) :: now
    !> Length, and share of the punch that is taken off
    real(wp), intent(in) :: length, off
    !> By rows: sums of p + d, and of the punch where it is positive
    real(wp), intent(out), contiguous :: part(:), punch(:)
    integer :: row, k

    !$omp parallel do schedule(static) num_threads(now%level%space%threads)
    do row = 1, size(now%p, 2)
      part(row) = 0.0_wp
      punch(row) = 0.0_wp
      do k = 1, now%n_run(row)
        associate (from => now%run(1, k, row), to => now%run(2, k, row))
          associate (p => now%p(from:to, row), active => now%active(from:to, row), d => now%d(from:to, row, 1), &
                     z => now%z(from:to, row, 1))
            if (now%by_load) then
              call projected_row(now%p_unit, p, active, d, part(row), [length, off], z, now%punch(from:to, row), punch(row))
            else
              call projected_row(now%p_unit, p, active, d, part(row), [length, 0.0_wp], z)
            end if
          end associate
        end associate
      end do
    end do
    !$omp end parallel do
  end subroutine cut

  !> Compute -g^T d, the fall of the energy along a direction by its length.
  real(wp) function steepness(now)
    !> Iterate
    type(normal_iterate_t), intent(in) :: now
    real(wp) :: part(size(now%p, 2))
    integer :: row, k

    !$omp parallel do schedule(static) num_threads(now%level%space%threads)
    do row = 1, size(now%p, 2)
      part(row) = 0.0_wp
      do k = 1, now%n_run(row)
        associate (from => now%run(1, k, row), to => now%run(2, k, row))
          ! the gap may be infinite where nothing can touch
          part(row) = part(row) + sum((now%approach - now%level%initial_gap(from:to, row) - now%w(from:to, row)) &
                                      *now%d(from:to, row, 1), mask=abs(now%d(from:to, row, 1)) > 0.0_sp)
        end associate
      end do
    end do
    !$omp end parallel do
    steepness = now%level%space%total(part)/now%w_unit
  end function steepness

  !> Compute the next direction of conjugate gradients.
  subroutine next_direction(now, recurrence)
    !> Iterate
    type(normal_iterate_t), intent(inout) :: now
    !> That of the last direction; on return that of the new one
    type(conjugate_gradient_t), intent(inout) :: recurrence
    real(wp) :: rz, share, sum_z
    real(sp) :: back, mean
    integer :: row, k

    call sum_active(now, now%z, sum_z, now%r, rz)
    call recurrence%last_share(rz, share)
    back = real(share, sp)
    mean = 0.0_sp
    if (now%by_load) mean = real(sum_z/now%punch_sum, sp)
    !$omp parallel do schedule(static) num_threads(now%level%space%threads)
    do row = 1, size(now%p, 2)
      do k = 1, now%n_run(row)
        associate (from => now%run(1, k, row), to => now%run(2, k, row))
          call direction_row(to - from + 1, back, now%z(from:to, row, 1), now%active(from:to, row), now%d(from:to, row, 1))
          if (now%by_load) now%d(from:to, row, 1) = now%d(from:to, row, 1) - mean*now%punch(from:to, row)
        end associate
      end do
    end do
    !$omp end parallel do
  end subroutine next_direction

  !> Compute the next direction of conjugate gradients on springs, which change from one direction to the next.
  !>
  !> It is conjugate to the last one by the springs as they are now, (N7), so that no step is lost where they change.
  subroutine next_sprung_direction(now, anew)
    !> Iterate
    type(normal_iterate_t), intent(inout) :: now
    !> There is no last direction
    logical, intent(in) :: anew
    real(wp) :: part(size(now%p, 2)), unit, sum_z
    real(sp) :: back, mean
    integer :: row

    mean = 0.0_sp
    if (now%by_load) then
      call sum_active(now, now%z, sum_z)
      mean = real(sum_z/now%punch_sum, sp)
    end if
    unit = now%p_unit/now%w_unit
    !$omp parallel do schedule(static) num_threads(now%level%space%threads)
    do row = 1, size(now%p, 2)
      now%z(:, row, 1) = merge(now%z(:, row, 1), 0.0_sp, now%active(:, row))
      if (now%by_load) now%z(:, row, 1) = now%z(:, row, 1) - mean*now%punch(:, row)
      part(row) = 0.0_wp
      if (.not. anew) part(row) = sum(now%z(:, row, 1)*(now%kd(:, row, 1) + unit*now%compliance(:, row)*now%d(:, row, 1)))
    end do
    !$omp end parallel do
    back = 0.0_sp
    if (.not. anew) back = max(real(-now%level%space%total(part)/curvature(now), sp), 0.0_sp)
    !$omp parallel do schedule(static) num_threads(now%level%space%threads)
    do row = 1, size(now%p, 2)
      if (anew) now%d(:, row, 1) = 0.0_sp
      now%d(:, row, 1) = now%z(:, row, 1) + back*now%d(:, row, 1)
    end do
    !$omp end parallel do
  end subroutine next_sprung_direction

  !> Compute d^T (K + C) d, C the springs of a compliant law.
  real(wp) function curvature(now)
    !> Iterate
    type(normal_iterate_t), intent(in) :: now
    real(wp) :: part(size(now%p, 2))
    integer :: row, k

    !$omp parallel do schedule(static) num_threads(now%level%space%threads)
    do row = 1, size(now%p, 2)
      part(row) = 0.0_wp
      do k = 1, now%n_run(row)
        associate (from => now%run(1, k, row), to => now%run(2, k, row))
          part(row) = part(row) + sum(real(now%d(from:to, row, 1), wp)*now%kd(from:to, row, 1))
          if (allocated(now%compliance)) part(row) = part(row) + now%p_unit/now%w_unit &
                                                     *sum(now%compliance(from:to, row)*real(now%d(from:to, row, 1), wp)**2)
        end associate
      end do
    end do
    !$omp end parallel do
    curvature = now%level%space%total(part)
  end function curvature

  !> Compute the length of the step along a direction by the springs of a compliant law; 0 if there is no curvature.
  real(wp) function find_sprung_step(now)
    !> Iterate
    type(normal_iterate_t), intent(in) :: now
    real(wp) :: total, fall, steepness

    call sum_active(now, now%d, total, now%r, fall)
    steepness = curvature(now)
    find_sprung_step = 0.0_wp
    if (steepness > 0.0_wp) find_sprung_step = fall/steepness
  end function find_sprung_step

end module hc_normal_directions
