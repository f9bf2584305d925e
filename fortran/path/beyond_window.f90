!> Overlap of the bodies outside of a window, which a contact that the window misses would have.
!>
!> The displacement there is that of point loads on half-spaces in place of the pressure (K. L. Johnson, Contact Mechanics, 1985,
!> eq. (3.22a)).
module hc_beyond_window
  use hc_precision, only: wp, pi
  use hc_lattice, only: lattice_t
  implicit none
  private

  public :: add_point_loads, deepest_overlap

contains

  !> Add the pressure in rows of a window to its point loads.
  pure subroutine add_point_loads(lattice, pressure, before, n_row, loads)
    !> Lattice of these rows
    type(lattice_t), intent(in) :: lattice
    !> Pressure there (n_col, n_row) [Pa]
    real(wp), intent(in) :: pressure(:, :)
    !> Rows of the window before them, and all of its rows
    integer, intent(in) :: before, n_row
    !> Loads [N], and the same times x and y [N m] (3, n_across, n_up), which divide the window evenly
    real(wp), intent(inout) :: loads(:, :, :)
    real(wp) :: x(size(pressure, 1)), y(size(pressure, 1)), load
    integer :: row, col, i, j

    do row = 1, size(pressure, 2)
      if (.not. any(pressure(:, row) > 0.0_wp)) cycle
      call lattice%row_coordinates(row, x, y)
      j = (before + row - 1)*size(loads, 3)/n_row + 1
      do col = 1, size(x)
        if (.not. pressure(col, row) > 0.0_wp) cycle
        load = pressure(col, row)*lattice%cell_area()
        i = (col - 1)*size(loads, 2)/size(x) + 1
        loads(:, i, j) = loads(:, i, j) + load*[1.0_wp, x(col), y(col)]
      end do
    end do
  end subroutine add_point_loads

  !> Return the number of the point where the bodies overlap most; 0: they overlap nowhere.
  pure integer function deepest_overlap(points, loads, approach, moduli, reach)
    !> Points outside of the window: x, y and the gap before loading (3, n_point) [m]
    real(wp), intent(in) :: points(:, :)
    !> Point loads, see `add_point_loads`
    real(wp), intent(in) :: loads(:, :, :)
    !> Approach of the bodies [m]
    real(wp), intent(in) :: approach
    !> Modulus E* of the bodies near to a load and far from it [Pa]
    real(wp), intent(in) :: moduli(2)
    !> Distance from which the latter holds [m]
    real(wp), intent(in) :: reach
    real(wp) :: deepest, overlap, distance
    integer :: k, i, j

    deepest_overlap = 0
    deepest = 0.0_wp
    do k = 1, size(points, 2)
      overlap = approach - points(3, k)
      do j = 1, size(loads, 3)
        if (overlap <= deepest) exit
        do i = 1, size(loads, 2)
          associate (load => loads(1, i, j))
            if (.not. load > 0.0_wp) cycle
            distance = norm2(points(:2, k) - loads(2:, i, j)/load)
            overlap = overlap - load/(pi*distance*merge(moduli(2), moduli(1), distance > reach))
          end associate
        end do
      end do
      if (overlap <= deepest) cycle
      deepest = overlap
      deepest_overlap = k
    end do
  end function deepest_overlap

end module hc_beyond_window
