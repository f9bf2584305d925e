!> Steps of an iteration for frictionless contact: direction and length.
!>
!> Equations: docs/theory/normal_contact.md, (N3) to (N5), (N7).
module hc_normal_directions
  use hc_precision, only: wp, sp
  use hc_conjugate_gradient, only: conjugate_gradient_t
  use hc_normal_lattice, only: normal_lattice_t
  use hc_normal_iterate, only: normal_iterate_t
  implicit none
  private

  public :: find_residual, projected_step, next_direction, next_sprung_direction, find_step, find_sprung_step

contains

  !> Compute r = approach - h - w on the active nodes.
  subroutine find_residual(level, now)
    !> Problem on the lattice, with its operators
    type(normal_lattice_t), intent(in) :: level
    !> Iterate
    type(normal_iterate_t), intent(inout) :: now
    real(wp) :: gap, scale
    integer :: col, row

    scale = 1.0_wp/now%w_unit
    !$omp parallel do schedule(static) num_threads(level%space%threads) private(col, gap)
    do row = 1, size(now%p, 2)
      !$omp simd private(gap)
      do col = now%span(1, row), now%span(2, row)
        gap = merge(level%initial_gap(col, row) + now%w(col, row) - now%approach, 0.0_wp, now%active(col, row))
        now%r(col, row, 1) = merge(real(-scale*gap, sp), now%r(col, row, 1), now%active(col, row))
      end do
    end do
    !$omp end parallel do
  end subroutine find_residual

  !> Compute d = max(p + c z, 0) - p on the active nodes, -p elsewhere; or the part of p on a fixed set.
  subroutine projected_step(level, now, fixed, by_load, pressures)
    !> Problem on the lattice, with its operators
    type(normal_lattice_t), intent(in) :: level
    !> Iterate
    type(normal_iterate_t), intent(inout) :: now
    !> The set of active nodes is fixed; the normal load is prescribed, not the approach
    logical, intent(in) :: fixed, by_load
    !> Sum of the pressures under a prescribed load
    real(wp), intent(in) :: pressures
    real(wp) :: part(size(now%p, 2)), aim, mean, row_sum, step_length
    real(sp) :: lack
    integer :: col, row

    step_length = level%options%normal%step_length
    mean = 0.0_wp
    if (by_load .and. .not. fixed) then
      !$omp parallel do schedule(static) num_threads(level%space%threads) private(col, row_sum)
      do row = 1, size(now%p, 2)
        row_sum = 0.0_wp
        !$omp simd reduction(+: row_sum)
        do col = now%span(1, row), now%span(2, row)
          row_sum = row_sum + merge(now%z(col, row, 1), 0.0_sp, now%active(col, row))
        end do
        part(row) = row_sum
      end do
      !$omp end parallel do
      mean = sum(part)/now%punch_sum
    end if
    !$omp parallel do schedule(static) num_threads(level%space%threads) private(col, aim)
    do row = 1, size(now%p, 2)
      now%d(:, row, 1) = 0.0_sp
      part(row) = 0.0_wp
      do col = now%span(1, row), now%span(2, row)
        aim = 0.0_wp
        if (now%active(col, row)) then
          aim = now%p(col, row)/now%p_unit
          if (.not. fixed) then
            aim = aim + step_length*now%z(col, row, 1)
            if (by_load) aim = aim - step_length*mean*now%punch(col, row)
          end if
          aim = max(aim, 0.0_wp)
          part(row) = part(row) + aim
        end if
        now%d(col, row, 1) = real(aim - now%p(col, row)/now%p_unit, sp)
      end do
    end do
    !$omp end parallel do
    if (.not. sum(part) > 0.0_wp) then
      ! none of the pressure is left where it should be
      now%d(:, :, 1) = now%d(:, :, 1) + merge(1.0_sp, 0.0_sp, now%active)
      part = count(now%active, dim=1)
    end if
    ! what was cut off goes where it changes the approach alone
    if (.not. by_load) return
    lack = real((pressures/now%p_unit - sum(part))/now%punch_sum, sp)
    !$omp parallel do schedule(static) num_threads(level%space%threads) private(col)
    do row = 1, size(now%p, 2)
      do col = now%span(1, row), now%span(2, row)
        now%d(col, row, 1) = now%d(col, row, 1) + lack*now%punch(col, row)
      end do
    end do
    !$omp end parallel do
  end subroutine projected_step

  !> Compute the next direction of conjugate gradients.
  subroutine next_direction(level, now, by_load, recurrence)
    !> Problem on the lattice, with its operators
    type(normal_lattice_t), intent(in) :: level
    !> Iterate
    type(normal_iterate_t), intent(inout) :: now
    !> The normal load is prescribed, not the approach
    logical, intent(in) :: by_load
    !> That of the last direction; on return that of the new one
    type(conjugate_gradient_t), intent(inout) :: recurrence
    real(wp), dimension(size(now%p, 2)) :: part, sum_z
    real(wp) :: share, z, product_z, total_z
    real(sp) :: back, mean
    logical :: anew
    integer :: col, row

    !$omp parallel do schedule(static) num_threads(level%space%threads) private(col, z, product_z, total_z)
    do row = 1, size(now%p, 2)
      product_z = 0.0_wp
      total_z = 0.0_wp
      !$omp simd private(z) reduction(+: product_z, total_z)
      do col = now%span(1, row), now%span(2, row)
        z = merge(now%z(col, row, 1), 0.0_sp, now%active(col, row))
        product_z = product_z + merge(now%r(col, row, 1), 0.0_sp, now%active(col, row))*z
        total_z = total_z + z
      end do
      part(row) = product_z
      sum_z(row) = total_z
    end do
    !$omp end parallel do
    call recurrence%last_share(sum(part), share, anew)
    back = real(share, sp)
    mean = 0.0_sp
    if (by_load) mean = real(sum(sum_z)/now%punch_sum, sp)
    !$omp parallel do schedule(static) num_threads(level%space%threads) private(col)
    do row = 1, size(now%p, 2)
      if (anew) now%d(:, row, 1) = 0.0_sp
      !$omp simd
      do col = now%span(1, row), now%span(2, row)
        now%d(col, row, 1) = merge(now%z(col, row, 1) + back*now%d(col, row, 1), 0.0_sp, now%active(col, row))
      end do
      if (.not. by_load) cycle
      !$omp simd
      do col = now%span(1, row), now%span(2, row)
        now%d(col, row, 1) = now%d(col, row, 1) - mean*now%punch(col, row)
      end do
    end do
    !$omp end parallel do
  end subroutine next_direction

  !> Compute the next direction of conjugate gradients on springs, which change from one direction to the next.
  !>
  !> It is conjugate to the last one by the springs as they are now, (N7), so that no step is lost where they change.
  subroutine next_sprung_direction(level, now, by_load, anew)
    !> Problem on the lattice, with its operators
    type(normal_lattice_t), intent(in) :: level
    !> Iterate
    type(normal_iterate_t), intent(inout) :: now
    !> The normal load is prescribed, not the approach; there is no last direction
    logical, intent(in) :: by_load, anew
    real(wp), dimension(size(now%p, 2)) :: part, sum_z
    real(wp) :: unit
    real(sp) :: back, mean
    integer :: row

    mean = 0.0_sp
    if (by_load) then
      !$omp parallel do schedule(static) num_threads(level%space%threads)
      do row = 1, size(now%p, 2)
        sum_z(row) = sum(real(now%z(:, row, 1), wp), mask=now%active(:, row))
      end do
      !$omp end parallel do
      mean = real(sum(sum_z)/now%punch_sum, sp)
    end if
    unit = now%p_unit/now%w_unit
    !$omp parallel do schedule(static) num_threads(level%space%threads)
    do row = 1, size(now%p, 2)
      now%z(:, row, 1) = merge(now%z(:, row, 1), 0.0_sp, now%active(:, row))
      if (by_load) now%z(:, row, 1) = now%z(:, row, 1) - mean*now%punch(:, row)
      part(row) = 0.0_wp
      if (.not. anew) part(row) = sum(now%z(:, row, 1)*(now%kd(:, row, 1) + unit*now%compliance(:, row)*now%d(:, row, 1)))
    end do
    !$omp end parallel do
    back = 0.0_sp
    if (.not. anew) back = max(real(-sum(part)/curvature(level, now), sp), 0.0_sp)
    !$omp parallel do schedule(static) num_threads(level%space%threads)
    do row = 1, size(now%p, 2)
      if (anew) now%d(:, row, 1) = 0.0_sp
      now%d(:, row, 1) = now%z(:, row, 1) + back*now%d(:, row, 1)
    end do
    !$omp end parallel do
  end subroutine next_sprung_direction

  !> Compute d^T (K + C) d, C the springs of a compliant law.
  real(wp) function curvature(level, now)
    !> Problem on the lattice, with its operators
    type(normal_lattice_t), intent(in) :: level
    !> Iterate
    type(normal_iterate_t), intent(in) :: now
    real(wp) :: part(size(now%p, 2))
    integer :: row

    !$omp parallel do schedule(static) num_threads(level%space%threads)
    do row = 1, size(now%p, 2)
      associate (from => now%span(1, row), to => now%span(2, row))
        part(row) = sum(real(now%d(from:to, row, 1), wp)*now%kd(from:to, row, 1))
        if (allocated(now%compliance)) part(row) = part(row) + now%p_unit/now%w_unit &
                                                   *sum(now%compliance(from:to, row)*real(now%d(from:to, row, 1), wp)**2)
      end associate
    end do
    !$omp end parallel do
    curvature = sum(part)
  end function curvature

  !> Compute the length of the step along a direction by the springs of a compliant law; 0 if there is no curvature.
  real(wp) function find_sprung_step(level, now)
    !> Problem on the lattice, with its operators
    type(normal_lattice_t), intent(in) :: level
    !> Iterate
    type(normal_iterate_t), intent(in) :: now
    real(wp) :: part(size(now%p, 2)), steepness
    integer :: row

    !$omp parallel do schedule(static) num_threads(level%space%threads)
    do row = 1, size(now%p, 2)
      part(row) = sum(real(now%d(:, row, 1), wp)*now%r(:, row, 1), mask=now%active(:, row))
    end do
    !$omp end parallel do
    steepness = curvature(level, now)
    find_sprung_step = 0.0_wp
    if (steepness > 0.0_wp) find_sprung_step = sum(part)/steepness
  end function find_sprung_step

  !> Compute the length of a step of conjugate gradients; 0 if there is no curvature.
  real(wp) function find_step(level, now, recurrence)
    !> Problem on the lattice, with its operators
    type(normal_lattice_t), intent(in) :: level
    !> Iterate
    type(normal_iterate_t), intent(in) :: now
    !> Recurrence of conjugate gradients
    type(conjugate_gradient_t), intent(in) :: recurrence

    find_step = recurrence%step_length(curvature(level, now))
  end function find_step

end module hc_normal_directions
