!> Geometry on the lattice, for Python: flat procedures for f2py, no mathematics.
!>
!> Fields have the shape (n_col, n_row), and zones are integers: not zero at nodes of the zone. The module has no state,
!> so that several threads may call at a time.
module hc_f2py_lattice
  use iso_c_binding, only: c_double, c_int
  use hc_error, only: error_t, status, raise
  use hc_f2py_handles, only: report
  use hc_lattice, only: lattice_t, new_lattice
  use hc_section_line, only: section_line_t, section_through, line_crossings
  use hc_zone_outline, only: zone_outline
  implicit none
  private

  public :: outline_of_zone, section_of_pressure, crossings_of_line

contains

  !> Find polygons around a zone that triangles fill.
  subroutine outline_of_zone(n_triangle, triangles, n_point, corners, polygon, n_corner)
    !f2py threadsafe
    !> Number of triangles
    integer(c_int), intent(in) :: n_triangle
    !> Corners of each triangle, counted from 1
    integer(c_int), intent(in) :: triangles(3, n_triangle)
    !> Number of points
    integer(c_int), intent(in) :: n_point
    !> Corners of the polygons, and the number of the polygon of each
    integer(c_int), intent(out) :: corners(3*n_triangle), polygon(3*n_triangle)
    !> Number of corners
    integer(c_int), intent(out) :: n_corner
    call zone_outline(triangles, n_point, corners, polygon, n_corner)
  end subroutine outline_of_zone

  !> Find the line in a direction across a contact.
  subroutine section_of_pressure(n_col, n_row, basis, first, origin, pressure, angle, is_given, point, ends, zero, code, message)
    !f2py threadsafe
    !> Number of columns and rows
    integer(c_int), intent(in) :: n_col, n_row
    !> Basis vectors as columns [m]
    real(c_double), intent(in) :: basis(2, 2)
    !> Smallest column and row index
    integer(c_int), intent(in) :: first(2)
    !> Position of node (0, 0) [m]
    real(c_double), intent(in) :: origin(2)
    !> Contact pressure [Pa]
    real(c_double), intent(in) :: pressure(n_col, n_row)
    !> Direction from x [rad]
    real(c_double), intent(in) :: angle
    !> Not zero: the line runs through the point; else through the node next to the centroid of the pressure
    integer(c_int), intent(in) :: is_given
    !> The point [m]
    real(c_double), intent(in) :: point(2)
    !> Ends of the line as columns, and the distance of its zero from the start [m]
    real(c_double), intent(out) :: ends(2, 2), zero
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error
    type(lattice_t) :: lattice
    type(section_line_t) :: line

    call new_lattice(lattice, basis, first, [n_col, n_row], error, origin)
    if (.not. allocated(error)) then
      if (is_given /= 0) then
        call section_through(lattice, pressure, angle, line, error, point)
      else
        call section_through(lattice, pressure, angle, line, error)
      end if
    end if
    ends = reshape([line%start, line%finish], [2, 2])
    zero = line%zero
    call report(error, code, message)
  end subroutine section_of_pressure

  !> Find where a line crosses edges of triangles.
  subroutine crossings_of_line(basis, origin, start, finish, n_most, distance, n_crossing, code, message)
    !f2py threadsafe
    !> Basis vectors as columns, position of node (0, 0) [m]
    real(c_double), intent(in) :: basis(2, 2), origin(2)
    !> Ends of the line [m]
    real(c_double), intent(in) :: start(2), finish(2)
    !> Room for crossings
    integer(c_int), intent(in) :: n_most
    !> Distances from the start [m]
    real(c_double), intent(out) :: distance(n_most)
    !> Number of crossings
    integer(c_int), intent(out) :: n_crossing
    !> Status and its message
    integer(c_int), intent(out) :: code
    character(len=512), intent(out) :: message
    type(error_t), allocatable :: error
    type(lattice_t) :: lattice
    real(c_double), allocatable :: found(:)

    distance = 0.0_c_double
    n_crossing = 0
    call new_lattice(lattice, basis, [0, 0], [1, 1], error, origin)
    if (.not. allocated(error)) then
      found = line_crossings(lattice, start, finish)
      n_crossing = size(found)
      if (n_crossing > n_most) then
        call raise(error, status%invalid_input, 'the line crosses more edges than there is room for')
      else
        distance(:n_crossing) = found
      end if
    end if
    call report(error, code, message)
  end subroutine crossings_of_line

end module hc_f2py_lattice
