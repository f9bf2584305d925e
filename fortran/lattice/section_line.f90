!> Lines across a contact, and where they cross the edges of the triangles: between two such points a field is linear.
module hc_section_line
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_lattice, only: lattice_t
  implicit none
  private

  public :: section_line_t, section_through, line_crossings

  !> Least margin of a section on both sides: in spacings, and as a part of the width of the contact.
  real(wp), parameter :: least_margin = 2.0_wp, margin_part = 0.15_wp
  !> Difference of pressures that are alike, as a share.
  real(wp), parameter :: alike = 1.0e-6_wp
  !> Spacings between crossings that are one.
  real(wp), parameter :: same = 1.0e-9_wp

  !> A line from a point to a point.
  type :: section_line_t
    !> Its ends [m]
    real(wp) :: start(2) = 0.0_wp, finish(2) = 0.0_wp
    !> Distance from the start at which it is zero [m]
    real(wp) :: zero = 0.0_wp
  end type section_line_t

contains

  !> Find the line in a direction across a contact, zero at a point of it.
  pure subroutine section_through(lattice, pressure, angle, line, error, point)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Contact pressure (n_col, n_row) [Pa]
    real(wp), intent(in) :: pressure(:, :)
    !> Direction from x [rad]
    real(wp), intent(in) :: angle
    !> Line, wider than the contact
    type(section_line_t), intent(out) :: line
    !> Allocated on failure: nothing is in contact
    type(error_t), allocatable, intent(out) :: error
    !> Point of the line [m]; default: the node next to the centroid of the pressure, where the lattice repeats that with the
    !> largest pressure
    real(wp), intent(in), optional :: point(2)
    real(wp), allocatable :: x(:, :), y(:, :), along(:, :)
    real(wp) :: through(2), way(2), ends(2), margin
    integer :: node(2)

    if (.not. any(pressure > 0.0_wp)) then
      call raise(error, status%invalid_input, &
                 'there is no contact in this load step, so it has no section; give start and end')
      return
    end if
    allocate (x, y, mold=pressure)
    call lattice%coordinates(x, y)
    if (present(point)) then
      through = point
    else
      through = [sum(x*pressure, mask=pressure > 0.0_wp), sum(y*pressure, mask=pressure > 0.0_wp)] &
                /sum(pressure, mask=pressure > 0.0_wp)
      ! contacts that repeat have no center: the largest pressure, of several alike the one in the middle
      node = minloc(hypot(x - through(1), y - through(2)), &
                    mask=.not. lattice%is_periodic() .or. pressure > (1.0_wp - alike)*maxval(pressure))
      through = [x(node(1), node(2)), y(node(1), node(2))]
    end if
    way = [cos(angle), sin(angle)]
    along = (x - through(1))*way(1) + (y - through(2))*way(2)
    ends = [minval(along, mask=pressure > 0.0_wp), maxval(along, mask=pressure > 0.0_wp)]
    margin = max(margin_part*(ends(2) - ends(1)), least_margin*lattice%spacing())
    ends = ends + [-margin, margin]
    if (lattice%is_periodic()) call stay_in_period(lattice, through, way, ends)
    line = section_line_t(through + ends(1)*way, through + ends(2)*way, -ends(1))
  end subroutine section_through

  !> Let a line from a point end with the cells of a window.
  pure subroutine stay_in_period(lattice, through, way, ends)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Point of the line [m] and its direction
    real(wp), intent(in) :: through(2), way(2)
    !> Distances of its ends from the point [m]
    real(wp), intent(inout) :: ends(2)
    real(wp) :: at(2), rate(2), sides(2), inside(2)
    integer :: d

    inside = ends
    at = lattice_position(lattice, through)
    rate = lattice_position(lattice, through + lattice%spacing()*way) - at
    do d = 1, 2
      if (.not. abs(rate(d)) > same) cycle
      sides = (lattice%first(d) - 0.5_wp + [0, lattice%extent(d)] - at(d))/rate(d)*lattice%spacing()
      inside = [max(inside(1), minval(sides)), min(inside(2), maxval(sides))]
    end do
    if (inside(1) < inside(2)) ends = inside ! a line that does not cross the window stays
  end subroutine stay_in_period

  !> Find the distances from the start at which a line crosses edges of triangles, rising, its ends included [m].
  pure function line_crossings(lattice, start, finish) result(distance)
    !> Lattice
    type(lattice_t), intent(in) :: lattice
    !> Ends of the line [m]
    real(wp), intent(in) :: start(2), finish(2)
    real(wp), allocatable :: distance(:)
    ! of columns, rows, and the edges between them: the numbers at both ends, of the next line to cross, and the step to it
    real(wp) :: first(3), last(3), line(3), step(3), share(3), before, length, gap
    integer :: n, k, i

    length = norm2(finish - start)
    gap = same*lattice%spacing()/length
    first(:2) = lattice_position(lattice, start)
    last(:2) = lattice_position(lattice, finish)
    first(3) = sum(first(:2))
    last(3) = sum(last(:2))
    step = sign(1.0_wp, last - first)
    do k = 1, 3
      line(k) = merge(real(ceiling(first(k)), wp), real(floor(first(k)), wp), step(k) > 0.0_wp)
    end do
    n = sum(ceiling(abs(last - first))) + 8
    allocate (distance(n))
    distance(1) = 0.0_wp
    n = 1
    before = -1.0_wp
    do
      share = huge(1.0_wp)
      where (abs(last - first) > same .and. (last - line)*step >= 0.0_wp) share = (line - first)/(last - first)
      i = minloc(share, dim=1)
      if (share(i) > 1.0_wp) exit
      line(i) = line(i) + step(i)
      if (share(i) > gap .and. share(i) < 1.0_wp - gap .and. share(i) - before > gap) then
        n = n + 1
        distance(n) = share(i)*length
      end if
      before = share(i)
    end do
    distance = [distance(:n), length]
  end function line_crossings

  !> Return column and row of a point, as real numbers.
  pure function lattice_position(lattice, point) result(at)
    !> Lattice
    type(lattice_t), intent(in) :: lattice
    !> Point [m]
    real(wp), intent(in) :: point(2)
    real(wp) :: at(2)

    associate (b => lattice%basis, away => point - lattice%origin)
      at = [b(2, 2)*away(1) - b(1, 2)*away(2), b(1, 1)*away(2) - b(2, 1)*away(1)]/lattice%cell_area()
    end associate
  end function lattice_position

end module hc_section_line
