!> Fields between a lattice and the lattice of its every second node.
!>
!> Node (i, j) of the coarse lattice is node (2 i, 2 j) of the fine one. The
!> interpolation is that of the piecewise linear pyramids themselves: the other
!> fine nodes are the midpoints of coarse edges.
!>
!> Theory: docs/theory/multilevel.md.
module hc_transfer
  use hc_precision, only: wp
  use hc_lattice, only: lattice_t, neighbors, floor_half
  use hc_field_space, only: field_space_t
  implicit none
  private

  public :: prolong, prolong_edge, prolong_shear, restrict_field, restrict_vector

contains

  !> Interpolate a field from the coarse to the fine lattice; zero outside the coarse window.
  subroutine prolong(coarse_lattice, coarse, fine_lattice, fine, space, beyond)
    !> Coarse lattice and window
    type(lattice_t), intent(in) :: coarse_lattice
    !> Coarse field (n_col, n_row)
    real(wp), intent(in) :: coarse(:, :)
    !> Fine lattice and window
    type(lattice_t), intent(in) :: fine_lattice
    !> Fine field (n_col, n_row)
    real(wp), intent(out) :: fine(:, :)
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    !> Beyond the coarse window there are the values at its rim; default: zero
    logical, intent(in), optional :: beyond
    !> Coarse values below and above a row of fine nodes, in a coarse row the same
    real(wp), dimension(floor_half(fine_lattice%first(1)):floor_half(fine_lattice%first(1) + size(fine, 1))) :: below, above
    integer :: row, i, j, c, last
    logical :: held

    held = .false.
    if (present(beyond)) held = beyond
    i = fine_lattice%first(1)
    last = i + size(fine, 1) - 1
    !$omp parallel do schedule(static) private(j, c, below, above) num_threads(space%threads_for(size(fine)))
    do row = 1, size(fine, 2)
      j = fine_lattice%first(2) + row - 1
      call take_row(coarse_lattice, coarse, floor_half(j), held, lbound(below, 1), below)
      call take_row(coarse_lattice, coarse, floor_half(j + 1), held, lbound(above, 1), above)
      do c = floor_half(i + 1), floor_half(last)
        fine(2*c - i + 1, row) = 0.5_wp*(below(c) + above(c))
      end do
      do c = floor_half(i), floor_half(last - 1)
        fine(2*c - i + 2, row) = 0.5_wp*(below(c + 1) + above(c))
      end do
    end do
    !$omp end parallel do
  end subroutine prolong

  !> Take a row of a coarse field and its continuation; a window continues with its other side where it repeats.
  pure subroutine take_row(lattice, field, row, held, first, values)
    !> Coarse lattice and window, and field (n_col, n_row)
    type(lattice_t), intent(in) :: lattice
    real(wp), intent(in) :: field(:, :)
    !> Index of the row, by the values at the rim, else by zero
    integer, intent(in) :: row
    logical, intent(in) :: held
    !> Index of the first column that is wanted, and the values from there on
    integer, intent(in) :: first
    real(wp), intent(out) :: values(first:)
    integer :: c, r

    r = row - lattice%first(2) + 1
    if (lattice%periodic(2)) r = modulo(r - 1, size(field, 2)) + 1
    associate (start => lattice%first(1), n => shape(field))
      values = 0.0_wp
      if ((r < 1 .or. r > n(2)) .and. .not. held) return
      r = min(max(r, 1), n(2))
      if (lattice%periodic(1)) then
        do c = first, ubound(values, 1)
          values(c) = field(modulo(c - start, n(1)) + 1, r)
        end do
      else if (held) then
        do c = first, ubound(values, 1)
          values(c) = field(min(max(c - start + 1, 1), n(1)), r)
        end do
      else
        do c = max(first, start), min(ubound(values, 1), start + n(1) - 1)
          values(c) = field(c - start + 1, r)
        end do
      end if
    end associate
  end subroutine take_row

  !> Interpolate a pressure that falls to zero at its edge like the root of the distance.
  !>
  !> Its square is linear there: the square is continued by a straight line into the
  !> nodes beyond the edge, interpolated, and cut off where it is negative. So the edge
  !> of the fine pressure lies where that of the coarse one does between nodes.
  subroutine prolong_edge(coarse_lattice, coarse, fine_lattice, fine, space)
    !> Coarse lattice and window
    type(lattice_t), intent(in) :: coarse_lattice
    !> Coarse pressure (n_col, n_row)
    real(wp), intent(in) :: coarse(:, :)
    !> Fine lattice and window
    type(lattice_t), intent(in) :: fine_lattice
    !> Fine pressure (n_col, n_row)
    real(wp), intent(out) :: fine(:, :)
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    real(wp), allocatable :: square(:, :)
    real(wp) :: beyond, around(size(coarse, 1))
    integer :: col, row, k, n, near(2), next(2), last

    last = size(coarse, 1)
    allocate (square(last, size(coarse, 2)))
    !$omp parallel do schedule(static) private(beyond, around, col, k, n, near, next) num_threads(space%threads_for(size(coarse)))
    do row = 1, size(coarse, 2)
      square(:, row) = max(coarse(:, row), 0.0_wp)**2
      ! only nodes with a neighbor under pressure are continued to
      around = 0.0_wp
      do k = 1, size(neighbors, 2)
        near = coarse_lattice%neighbor([1 + max(0, -neighbors(1, k)), row], k)
        if (near(1) == 0) cycle
        associate (c => neighbors(1, k), r => near(2))
          around(max(1, 1 - c):min(last, last - c)) = max(around(max(1, 1 - c):min(last, last - c)), &
                                                          coarse(max(1, 1 + c):min(last, last + c), r))
        end associate
      end do
      if (coarse_lattice%periodic(1)) around([1, last]) = 1.0_wp
      do col = 1, last
        if (coarse(col, row) > 0.0_wp .or. .not. around(col) > 0.0_wp) cycle
        beyond = 0.0_wp
        n = 0
        do k = 1, size(neighbors, 2)
          near = coarse_lattice%neighbor([col, row], k)
          if (near(1) == 0) cycle
          next = coarse_lattice%neighbor(near, k)
          if (next(1) == 0) cycle
          if (.not. min(coarse(near(1), near(2)), coarse(next(1), next(2))) > 0.0_wp) cycle
          beyond = beyond + min(2.0_wp*coarse(near(1), near(2))**2 - coarse(next(1), next(2))**2, 0.0_wp)
          n = n + 1
        end do
        if (n > 0) square(col, row) = beyond/n
      end do
    end do
    !$omp end parallel do
    call prolong(coarse_lattice, square, fine_lattice, fine, space)
    !$omp parallel do schedule(static) num_threads(space%threads_for(size(fine)))
    do row = 1, size(fine, 2)
      fine(:, row) = sqrt(max(fine(:, row), 0.0_wp))
    end do
    !$omp end parallel do
  end subroutine prolong_edge

  !> Interpolate a shear traction as its ratio to the pressure: where a node slips it stays on the cone.
  subroutine prolong_shear(coarse_lattice, coarse_pressure, coarse, fine_lattice, fine_pressure, fine, space)
    !> Coarse lattice and window
    type(lattice_t), intent(in) :: coarse_lattice
    !> Coarse pressure (n_col, n_row) and shear traction (n_col, n_row, 2)
    real(wp), intent(in) :: coarse_pressure(:, :), coarse(:, :, :)
    !> Fine lattice and window
    type(lattice_t), intent(in) :: fine_lattice
    !> Fine pressure (n_col, n_row)
    real(wp), intent(in) :: fine_pressure(:, :)
    !> Fine shear traction (n_col, n_row, 2)
    real(wp), intent(out) :: fine(:, :, :)
    !> Space of the fields
    type(field_space_t), intent(in) :: space
    real(wp), allocatable :: ratio(:, :, :)
    integer :: col, row, k, n, near(2)

    allocate (ratio, mold=coarse)
    !$omp parallel do schedule(static) private(col, k, n, near) num_threads(space%threads_for(size(coarse_pressure)))
    do row = 1, size(coarse, 2)
      do col = 1, size(coarse, 1)
        ratio(col, row, :) = 0.0_wp
        if (coarse_pressure(col, row) > 0.0_wp) then
          ratio(col, row, :) = coarse(col, row, :)/coarse_pressure(col, row)
          cycle
        end if
        ! beyond the edge: that of the neighbors in contact
        n = 0
        do k = 1, size(neighbors, 2)
          near = coarse_lattice%neighbor([col, row], k)
          if (near(1) == 0) cycle
          if (.not. coarse_pressure(near(1), near(2)) > 0.0_wp) cycle
          ratio(col, row, :) = ratio(col, row, :) + coarse(near(1), near(2), :)/coarse_pressure(near(1), near(2))
          n = n + 1
        end do
        if (n > 0) ratio(col, row, :) = ratio(col, row, :)/n
      end do
    end do
    !$omp end parallel do
    do k = 1, size(fine, 3)
      call prolong(coarse_lattice, ratio(:, :, k), fine_lattice, fine(:, :, k), space)
    end do
    !$omp parallel do schedule(static) private(k) num_threads(space%threads_for(size(fine_pressure)))
    do row = 1, size(fine, 2)
      do k = 1, size(fine, 3)
        fine(:, row, k) = fine(:, row, k)*max(fine_pressure(:, row), 0.0_wp)
      end do
    end do
    !$omp end parallel do
  end subroutine prolong_shear

  !> Return the values of a field at the coarse nodes.
  pure function restrict_field(fine_lattice, fine, coarse_lattice) result(coarse)
    !> Fine lattice and window
    type(lattice_t), intent(in) :: fine_lattice
    !> Fine field (n_col, n_row)
    real(wp), intent(in) :: fine(:, :)
    !> Coarse lattice and window, inside the fine one
    type(lattice_t), intent(in) :: coarse_lattice
    !> Coarse field (n_col, n_row)
    real(wp) :: coarse(coarse_lattice%extent(1), coarse_lattice%extent(2))
    integer :: start(2)

    start = 2*coarse_lattice%first - fine_lattice%first + 1
    coarse = fine(start(1)::2, start(2)::2)
  end function restrict_field

  !> Return the values of all components of a field at the coarse nodes.
  pure function restrict_vector(fine_lattice, fine, coarse_lattice) result(coarse)
    !> Fine lattice and window
    type(lattice_t), intent(in) :: fine_lattice
    !> Fine field (n_col, n_row, number of components)
    real(wp), intent(in) :: fine(:, :, :)
    !> Coarse lattice and window, inside the fine one
    type(lattice_t), intent(in) :: coarse_lattice
    !> Coarse field (n_col, n_row, number of components)
    real(wp) :: coarse(coarse_lattice%extent(1), coarse_lattice%extent(2), size(fine, 3))
    integer :: m

    do m = 1, size(fine, 3)
      coarse(:, :, m) = restrict_field(fine_lattice, fine(:, :, m), coarse_lattice)
    end do
  end function restrict_vector

end module hc_transfer
