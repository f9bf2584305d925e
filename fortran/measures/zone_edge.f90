!> The edge of a zone between the nodes, and a mesh of the zone that ends there.
!>
!> The distance from the edge is known at the nodes about it, positive inside, in spacings. It is linear on the triangles
!> of the lattice, and the edge is where it is zero. Where a triangle has a node that can never touch, as at the rim of a
!> punch, the zone ends half-way to it: with the cells of its nodes. Fields have the shape (n_col, n_row).
!>
!> Equations: docs/theory/edges.md, (B5).
module hc_zone_edge
  use, intrinsic :: iso_fortran_env, only: int8, int64
  use hc_precision, only: wp, pi
  use hc_options, only: edge_options_t
  use hc_lattice, only: lattice_t
  use hc_edge_band, only: edge_band_t
  use hc_zone_estimators, only: ellipse_t, ellipse_of_moments
  implicit none
  private

  public :: edged_zone_t, zone_edge_t, zone_mesh_t, edge_of_sums, n_cell_sum, cut_triangles

  !> Corners of the lower and of the upper triangle of a cell, counterclockwise: column and row.
  integer, parameter :: corner(2, 3, 2) = reshape([0, 0, 1, 0, 0, 1, 1, 1, 0, 1, 1, 0], [2, 3, 2])

  !> Sums over the cells of a row: covered triangles, six moments, and the length of the edge.
  integer, parameter :: n_cell_sum = 8

  !> Nodes of a zone, and the distances from its edge of those about it.
  type :: edged_zone_t
    !> Lattice and window
    type(lattice_t) :: lattice
    !> Nodes of the zone, and those that can touch (n_col, n_row)
    logical, allocatable :: zone(:, :), candidate(:, :)
    !> Nodes about the edge, and their distances from it in spacings, positive inside
    type(edge_band_t) :: band
    real(wp), allocatable :: distance(:)
    !> Tuning numbers
    type(edge_options_t) :: options
  contains
    !> The edge; sums over its cells by row
    procedure :: edge => edge_of_zone
    procedure :: sum_cells
    !> Triangles that fill the zone, and a field there
    procedure :: mesh => mesh_of_zone
    !> Distances of all nodes from the edge
    procedure :: distances => distance_field
  end type edged_zone_t

  !> An area of the plane whose edge runs between the nodes.
  type :: zone_edge_t
    !> Area [m^2], and length of its edge [m]
    real(wp) :: area = 0.0_wp, length = 0.0_wp
    !> Ellipse with the second moments of the area; of an elliptic area it is the edge
    type(ellipse_t) :: ellipse
    !> Pieces of the edge, in no order: x and y, first and last point; none where the zone ends at nodes that can never
    !> touch (2, 2, n) [m]
    real(wp), allocatable :: segments(:, :, :)
  contains
    !> Radius of the disc with the same area [m]
    procedure :: radius
  end type zone_edge_t

  !> Triangles that fill a zone up to its edge, and a field on them.
  type :: zone_mesh_t
    !> Corners (2, n) [m], and the field there (n)
    real(wp), allocatable :: points(:, :), values(:)
    !> Numbers of the corners of each triangle, counted from 1, counterclockwise (3, m)
    integer, allocatable :: triangles(:, :)
    !> Number of points and of triangles
    integer :: n_point = 0, n_triangle = 0
  contains
    procedure, private :: add_point, add_polygon, trim
  end type zone_mesh_t

contains

  !> Return the radius of the disc with the same area [m].
  pure real(wp) function radius(self)
    class(zone_edge_t), intent(in) :: self
    radius = sqrt(self%area/pi)
  end function radius

  !> Count the triangles that the edge of a zone cuts.
  pure integer function cut_triangles(zone)
    !> Nodes of the zone (n_col, n_row)
    logical, intent(in) :: zone(:, :)
    integer :: n_with(0:3)

    n_with = triangles(with_rim(zone))
    cut_triangles = n_with(1) + n_with(2)
  end function cut_triangles

  !> Return a zone with a rim of nodes outside it: 1 in the zone, else 0.
  pure function with_rim(zone) result(padded)
    !> Nodes of the zone (n_col, n_row)
    logical, intent(in) :: zone(:, :)
    integer(int8) :: padded(0:size(zone, 1) + 1, 0:size(zone, 2) + 1)

    padded = 0_int8
    padded(1:size(zone, 1), 1:size(zone, 2)) = merge(1_int8, 0_int8, zone)
  end function with_rim

  !> Count the triangles with no, one, two and three corners in a zone.
  pure function triangles(padded) result(n_with)
    !> Zone with a rim
    integer(int8), intent(in) :: padded(0:, 0:)
    integer :: n_with(0:3), col, row, half, inside(2)

    n_with = 0
    do row = 0, ubound(padded, 2) - 1
      do col = 0, ubound(padded, 1) - 1
        inside = nodes_inside(padded(col:col + 1, row:row + 1))
        do half = 1, 2
          n_with(inside(half)) = n_with(inside(half)) + 1
        end do
      end do
    end do
  end function triangles

  !> Count the corners of the lower and of the upper triangle of a cell that are in a zone.
  pure function nodes_inside(cell) result(inside)
    !> Its nodes: 1 in the zone, else 0
    integer(int8), intent(in) :: cell(2, 2)
    integer :: inside(2)
    inside = cell(2, 1) + cell(1, 2) + [cell(1, 1), cell(2, 2)]
  end function nodes_inside

  !> Cut the triangles at the edge of a zone.
  pure function edge_of_zone(self) result(edge)
    class(edged_zone_t), intent(in) :: self
    type(zone_edge_t) :: edge
    real(wp), allocatable :: segments(:, :, :), sums(:, :)
    integer :: n, k

    call self%sum_cells([0, size(self%zone, 2), 0], sums, segments)
    edge = edge_of_sums(self%lattice, [(sum(sums(k, :)), k=1, n_cell_sum)])
    allocate (edge%segments, mold=segments)
    do n = 1, size(segments, 3)
      do k = 1, 2
        edge%segments(:, k, n) = position(self%lattice, segments(:, k, n))
      end do
    end do
  end function edge_of_zone

  !> Sum the cells of a zone by row: covered triangles, moments of the area (1, x, y, xx, xy, yy) in columns and rows, and the
  !> length of its edge [m].
  pure subroutine sum_cells(self, rows, sums, segments)
    class(edged_zone_t), intent(in) :: self
    !> First and last row of cells, each named by the row of nodes below it, and rows of the window before those of the zone
    integer, intent(in) :: rows(3)
    !> Sums of each row of cells
    real(wp), allocatable, intent(out) :: sums(:, :)
    !> Pieces of the edge, in columns and rows (2, 2, n)
    real(wp), allocatable, intent(out) :: segments(:, :, :)
    integer(int8) :: padded(0:size(self%zone, 1) + 1, 0:size(self%zone, 2) + 1)
    logical, allocatable :: can_touch(:)
    real(wp) :: moments(6), sign
    integer(int64) :: whole(3, 2)  ! whole triangles of a row, sums of columns and of their squares over them
    integer :: n_with(0:3), inside(2), local(2, 3), corners(2, 3), at(3), lone, col, row, half, n

    padded = with_rim(self%zone)
    n_with = triangles(padded)
    can_touch = self%band%part_of(self%candidate)
    allocate (segments(2, 2, n_with(1) + n_with(2)), sums(n_cell_sum, rows(1):rows(2)))
    n = 0
    do row = rows(1), rows(2)
      whole = 0_int64
      moments = 0.0_wp
      sums([1, 8], row) = 0.0_wp
      do col = 0, size(self%zone, 1)
        inside = nodes_inside(padded(col:col + 1, row:row + 1))
        do half = 1, 2
          if (inside(half) == 0) cycle
          if (inside(half) == 3) then
            whole(:, half) = whole(:, half) + [1, col, col*col]
            cycle
          end if
          local = corners_of(half) + spread([col, row], 2, 3)
          corners = local + spread([0, rows(3)], 2, 3)
          at = [(self%band%place(local(1, lone), local(2, lone)), lone=1, 3)]
          if (all(can_touch(at))) then
            n = n + 1
            call cut(real(corners, wp), self%distance(at), lone, segments(:, :, n), sums(1, row))
            sums(8, row) = sums(8, row) + norm2(matmul(self%lattice%basis, segments(:, 2, n) - segments(:, 1, n)))
            sign = merge(1.0_wp, -1.0_wp, inside(half) == 1)
            if (inside(half) == 2) moments = moments + moments_of(real(corners, wp))
            moments = moments + sign*moments_of(reshape([real(corners(:, lone), wp), segments(:, :, n)], [2, 3]))
          else
            sums(1, row) = sums(1, row) + inside(half)/3.0_wp
            do lone = 1, 3  ! a third of the triangle for each node inside, in the moments at the node
              if (padded(local(1, lone), local(2, lone)) /= 0) then
                moments = moments + moments_of(spread(real(corners(:, lone), wp), 2, 3), 1.0_wp/6.0_wp)
              end if
            end do
          end if
        end do
      end do
      sums(1, row) = sums(1, row) + sum(whole(1, :))
      do half = 1, 2
        moments = moments + moments_of_whole(half, row + rows(3), real(whole(:, half), wp))
      end do
      sums(2:7, row) = moments
    end do
    segments = segments(:, :, :n)
  end subroutine sum_cells

  !> Find area and ellipse of a zone from the sums over its cells.
  pure function edge_of_sums(lattice, sums) result(edge)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Sums of all rows, see `sum_cells`
    real(wp), intent(in) :: sums(n_cell_sum)
    type(zone_edge_t) :: edge

    edge%area = 0.5_wp*lattice%cell_area()*sums(1)
    edge%length = sums(8)
    if (sums(2) > 0.0_wp) edge%ellipse = ellipse_of(lattice, sums(2:7))
  end function edge_of_sums

  !> Return the corners of the lower or upper triangle of the cell at column and row 0.
  pure function corners_of(half) result(corners)
    !> 1: the lower triangle, 2: the upper one
    integer, intent(in) :: half
    !> Columns and rows
    integer :: corners(2, 3)
    corners = reshape([half - 1, half - 1, 1, 0, 0, 1], [2, 3])
  end function corners_of

  !> Add up the moments of lower or upper triangles in a row, as `moments_of`: those of one, shifted to each cell.
  pure function moments_of_whole(half, row, sums) result(moments)
    !> 1: lower triangles, 2: upper ones
    integer, intent(in) :: half
    !> Their row
    integer, intent(in) :: row
    !> Their number, and sums of the columns of their cells and of the squares
    real(wp), intent(in) :: sums(3)
    real(wp) :: moments(6)

    associate (one => moments_of(real(corners_of(half), wp)), y => real(row, wp))
      moments = one*sums(1)
      moments(2) = moments(2) + one(1)*sums(2)
      moments(3) = moments(3) + one(1)*y*sums(1)
      moments(4) = moments(4) + 2.0_wp*one(2)*sums(2) + one(1)*sums(3)
      moments(5) = moments(5) + one(2)*y*sums(1) + one(3)*sums(2) + one(1)*y*sums(2)
      moments(6) = moments(6) + 2.0_wp*one(3)*y*sums(1) + one(1)*y*y*sums(1)
    end associate
  end function moments_of_whole

  !> Return the place of a column and row, counted from 1 [m].
  pure function position(lattice, index)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Column and row
    real(wp), intent(in) :: index(2)
    real(wp) :: position(2)
    position = lattice%origin + matmul(lattice%basis, lattice%first - 1 + index)
  end function position

  !> Compute the area of a triangle, its first moments and its second ones (xx, xy, yy), in columns and rows.
  pure function moments_of(corners, area) result(moments)
    !> Columns and rows of the corners
    real(wp), intent(in) :: corners(2, 3)
    !> Area, if it is another one
    real(wp), intent(in), optional :: area
    real(wp) :: moments(6), total(2)

    total = sum(corners, dim=2)
    associate (a => corners(:, 2) - corners(:, 1), b => corners(:, 3) - corners(:, 1))
      moments(1) = 0.5_wp*abs(a(1)*b(2) - a(2)*b(1))
    end associate
    if (present(area)) moments(1) = area
    moments(2:3) = total/3.0_wp
    moments(4) = (sum(corners(1, :)**2) + total(1)**2)/12.0_wp
    moments(5) = (sum(corners(1, :)*corners(2, :)) + total(1)*total(2))/12.0_wp
    moments(6) = (sum(corners(2, :)**2) + total(2)**2)/12.0_wp
    moments(2:) = moments(1)*moments(2:)
  end function moments_of

  !> Find the ellipse with the moments of an area, (B5).
  pure function ellipse_of(lattice, moments) result(ellipse)
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Area, first and second moments in columns and rows
    real(wp), intent(in) :: moments(6)
    type(ellipse_t) :: ellipse
    real(wp) :: central(2, 2)

    associate (mean => moments(2:3)/moments(1))
      central = reshape([moments(4), moments(5), moments(5), moments(6)]/moments(1), [2, 2]) &
                - spread(mean, 2, 2)*spread(mean, 1, 2)
      central = matmul(lattice%basis, matmul(central, transpose(lattice%basis)))
      ellipse = ellipse_of_moments(position(lattice, mean), central(1, 1), central(1, 2), central(2, 2))
    end associate
  end function ellipse_of

  !> Cut one triangle: add its part inside, and return the ends of the piece of the edge.
  pure subroutine cut(corners, distance, lone, ends, covered)
    !> Column and row of the corners, and their distances
    real(wp), intent(in) :: corners(2, 3), distance(3)
    !> Number of the corner that is alone on its side
    integer, intent(out) :: lone
    !> Columns and rows of both ends
    real(wp), intent(out) :: ends(2, 2)
    !> Area inside so far, in triangles
    real(wp), intent(inout) :: covered
    real(wp) :: way
    integer :: order(3), k

    ! the corner that is on its own side goes first
    order = modulo(findloc(distance > 0.0_wp, count(distance > 0.0_wp) == 1, dim=1) + [-1, 0, 1], 3) + 1
    lone = order(1)
    way = 1.0_wp
    do k = 1, 2
      associate (one => distance(order(1)), other => distance(order(k + 1)))
        way = way*(one/(one - other))
        ends(:, k) = corners(:, order(1)) + one/(one - other)*(corners(:, order(k + 1)) - corners(:, order(1)))
      end associate
    end do
    covered = covered + merge(way, 1.0_wp - way, distance(order(1)) > 0.0_wp)
  end subroutine cut

  !> Return the distances of all nodes from the edge, in spacings, cut off far away; at the rim of a punch the edge is half-way.
  pure function distance_field(self) result(field)
    class(edged_zone_t), intent(in) :: self
    real(wp) :: field(size(self%zone, 1), size(self%zone, 2))
    logical, allocatable :: inside(:), can_touch(:)
    integer :: k, j

    associate (away => self%options%largest_distance, zone => self%zone, band => self%band, distance => self%distance)
      field = merge(away, -away, zone)
      allocate (inside, source=band%part_of(zone))
      can_touch = band%part_of(self%candidate)
      do k = 1, band%n
        associate (col => band%node(1, k), row => band%node(2, k))
          if (min(col, row) < 1 .or. col > size(zone, 1) .or. row > size(zone, 2)) cycle
          field(col, row) = min(max(distance(k), -away), away)
          if (inside(k) .or. can_touch(k)) cycle
          do j = 1, size(band%beside, 1)
            associate (m => band%beside(j, k))
              if (m == 0) cycle
              if (inside(m)) field(col, row) = min(field(col, row), -min(distance(m), away))
            end associate
          end do
        end associate
      end do
    end associate
  end function distance_field

  !> Fill a zone with triangles up to its edge, and carry a field there.
  !>
  !> At the edge the field vanishes, or is extrapolated from the last two nodes on its line of nodes. Half-way to a
  !> node that can never touch it is that of the node inside.
  pure function mesh_of_zone(self, field, vanishes) result(mesh)
    class(edged_zone_t), intent(in) :: self
    !> Values at the nodes; only those of the zone matter
    real(wp), intent(in) :: field(:, :)
    !> Whether they vanish at the edge, like tractions
    logical, intent(in) :: vanishes
    type(zone_mesh_t) :: mesh
    integer(int8) :: padded(0:size(self%zone, 1) + 1, 0:size(self%zone, 2) + 1)
    logical, allocatable :: can_touch(:)
    integer, allocatable :: at_node(:, :), at_cut(:, :, :)
    integer :: n_with(0:3), polygon(5), ends(2, 2), base(2), kind, length, col, row, half, k
    real(wp) :: part, value
    logical :: touches

    padded = with_rim(self%zone)
    n_with = triangles(padded)
    can_touch = self%band%part_of(self%candidate)
    associate (n_cut => n_with(1) + n_with(2), n_node => count(self%zone))
      allocate (mesh%points(2, n_node + 2*n_cut), mesh%values(n_node + 2*n_cut), mesh%triangles(3, n_with(3) + 2*n_cut))
    end associate
    allocate (at_node(0:size(self%zone, 1) + 1, 0:size(self%zone, 2) + 1), source=0)
    allocate (at_cut(0:size(self%zone, 1) + 1, 0:size(self%zone, 2) + 1, 3), source=0)
    do row = 0, size(self%zone, 2)
      do col = 0, size(self%zone, 1)
        do half = 1, 2
          length = 0
          do k = 1, 3
            ends(:, 1) = [col, row] + corner(:, k, half)
            ends(:, 2) = [col, row] + corner(:, modulo(k, 3) + 1, half)
            associate (here => ends(:, 1), next => ends(:, 2), number => at_node(ends(1, 1), ends(2, 1)))
              if (padded(here(1), here(2)) /= 0) then
                if (number == 0) call mesh%add_point(position(self%lattice, real(here, wp)), field(here(1), here(2)), number)
                length = length + 1
                polygon(length) = number
              end if
              if (padded(here(1), here(2)) == padded(next(1), next(2))) cycle
              if (padded(here(1), here(2)) == 0) ends = ends(:, 2:1:-1)
            end associate
            associate (node => ends(:, 1), beyond => ends(:, 2), link => ends(:, 2) - ends(:, 1))
              touches = can_touch(self%band%place(beyond(1), beyond(2)))
              length = length + 1
              base = merge(node, beyond, link(2) > 0 .or. (link(2) == 0 .and. link(1) > 0))
              kind = merge(1, merge(2, 3, link(1) == 0), link(2) == 0)
              if (at_cut(base(1), base(2), kind) == 0) then
                part = 0.5_wp  ! the edge of the cells
                value = field(node(1), node(2))
                if (touches) then
                  part = part_inside(self%distance([self%band%place(node(1), node(2)), self%band%place(beyond(1), beyond(2))]))
                  if (vanishes) then
                    value = 0.0_wp
                  else if (padded(node(1) - link(1), node(2) - link(2)) /= 0) then
                    value = value + part*(value - field(node(1) - link(1), node(2) - link(2)))
                  end if
                end if
                call mesh%add_point(position(self%lattice, node + part*link), value, at_cut(base(1), base(2), kind))
              end if
              polygon(length) = at_cut(base(1), base(2), kind)
            end associate
          end do
          if (length == 0) cycle
          call mesh%add_polygon(polygon(:length))
        end do
      end do
    end do
    call mesh%trim()
  end function mesh_of_zone

  !> Return the part of a link that is inside, from the distances of the node inside and the one beyond.
  pure real(wp) function part_inside(distance)
    !> Distances from the edge, positive inside
    real(wp), intent(in) :: distance(2)
    part_inside = distance(1)/(distance(1) - distance(2))
  end function part_inside

  !> Free the room for points and triangles that were not needed.
  pure subroutine trim(mesh)
    class(zone_mesh_t), intent(inout) :: mesh
    mesh%points = mesh%points(:, :mesh%n_point)
    mesh%values = mesh%values(:mesh%n_point)
    mesh%triangles = mesh%triangles(:, :mesh%n_triangle)
  end subroutine trim

  !> Add a point to a mesh.
  pure subroutine add_point(mesh, point, value, number)
    class(zone_mesh_t), intent(inout) :: mesh
    !> Its place [m], and the field there
    real(wp), intent(in) :: point(2), value
    !> Its number
    integer, intent(out) :: number

    mesh%n_point = mesh%n_point + 1
    number = mesh%n_point
    mesh%points(:, number) = point
    mesh%values(number) = value
  end subroutine add_point

  !> Add the triangles of a polygon, all with its first corner.
  pure subroutine add_polygon(mesh, corners)
    class(zone_mesh_t), intent(inout) :: mesh
    !> Numbers of its corners, counterclockwise
    integer, intent(in) :: corners(:)
    integer :: k

    do k = 2, size(corners) - 1
      mesh%n_triangle = mesh%n_triangle + 1
      mesh%triangles(:, mesh%n_triangle) = [corners(1), corners(k), corners(k + 1)]
    end do
  end subroutine add_polygon

end module hc_zone_edge
