!> Ways to spread the pressure of a node over the surface, compared on Hertz's contact: a point force, a constant load on the
!> hexagonal cell, and the pyramid.
!>
!> Lengths are in spacings, and each load has the volume of the unit pyramid, sqrt(3)/2. The contact is that of a sphere of
!> radius 1 with E* = 1: approach a^2, largest pressure 2 a/pi. Figure 7.3 of the dissertation; docs/theory/discretisation.md.
module hc_load_shapes
  use hc_precision, only: wp, pi
  use hc_lattice, only: equilateral_basis
  use hc_triangle_integrals, only: triangle_integrals
  use hc_pyramid_influence, only: pyramid_t, new_pyramid
  implicit none
  private

  public :: point_force, constant_cell, unit_pyramid
  public :: load_potential, displacement_errors, pressure_errors

  !> Shapes of a load.
  integer, parameter :: point_force = 1, constant_cell = 2, unit_pyramid = 3
  !> Distance of rows; also the area of a cell.
  real(wp), parameter :: height = sqrt(0.75_wp)
  !> Points along a side of a triangle at which pressures are compared, and the part of the contact radius within which.
  integer, parameter :: n_side = 16
  real(wp), parameter :: compared = 0.8_wp
  !> Part of the contact radius within which nodes are loaded: more than all in contact.
  real(wp), parameter :: reached = 1.2_wp

contains

  !> Integrate a load over the distance of a point: its displacement, times pi E*.
  pure function load_potential(shape_number, x, y) result(potential)
    !> point_force, constant_cell or unit_pyramid
    integer, intent(in) :: shape_number
    !> Points relative to the node
    real(wp), intent(in) :: x(:), y(:)
    real(wp) :: potential(size(x))
    type(pyramid_t) :: pyramid

    call new_pyramid(pyramid, equilateral_basis(1.0_wp))
    potential = potential_of(shape_number, pyramid, x, y)
  end function load_potential

  !> Compute the error of the displacement under Hertz's pressure at the nodes, over the approach.
  pure function displacement_errors(shape_number, radius, x, y) result(errors)
    !> point_force, constant_cell or unit_pyramid
    integer, intent(in) :: shape_number
    !> Contact radius
    real(wp), intent(in) :: radius
    !> Points
    real(wp), intent(in) :: x(:), y(:)
    real(wp) :: errors(size(x))
    type(pyramid_t) :: pyramid
    real(wp) :: node(2)
    integer :: reach, row, col

    call new_pyramid(pyramid, equilateral_basis(1.0_wp))
    reach = int(reached*radius) + 2
    errors = 0.0_wp
    do row = -reach, reach
      do col = -2*reach, 2*reach
        node = [col + 0.5_wp*row, height*row]
        if (norm2(node) >= radius) cycle
        errors = errors + hertz_pressure(radius, norm2(node))*potential_of(shape_number, pyramid, x - node(1), y - node(2))
      end do
    end do
    errors = (errors/pi - (radius**2 - 0.5_wp*(x**2 + y**2)))/radius**2
  end function displacement_errors

  !> Compute the largest errors of Hertz's pressure, over its peak: constant on cells, and linear between the nodes.
  pure function pressure_errors(radius) result(errors)
    !> Contact radius
    real(wp), intent(in) :: radius
    real(wp) :: errors(2)
    real(wp) :: corner(2, 3), at_nodes(3), share(3), place(2), exact
    integer :: reach, row, col, i, j

    reach = int(reached*radius) + 1
    errors = 0.0_wp
    do row = -reach, reach - 1
      do col = -2*reach, 2*reach - 1
        ! the other triangles are mirror images of these
        corner = reshape([col + 0.5_wp*row, height*row, col + 1 + 0.5_wp*row, height*row, &
                          col + 0.5_wp*(row + 1), height*(row + 1)], [2, 3])
        at_nodes = hertz_pressure(radius, norm2(corner, dim=1))
        do j = 0, n_side
          do i = 0, n_side - j
            share = [n_side - i - j, i, j]/real(n_side, wp)
            place = matmul(corner, share)
            if (norm2(place) >= compared*radius) cycle
            exact = hertz_pressure(radius, norm2(place))
            errors = max(errors, abs([at_nodes(maxloc(share, dim=1)), dot_product(at_nodes, share)] - exact))
          end do
        end do
      end do
    end do
    errors = errors/hertz_pressure(radius, 0.0_wp)
  end function pressure_errors

  !> Evaluate Hertz's pressure at a distance from the middle.
  elemental real(wp) function hertz_pressure(radius, distance)
    !> Contact radius, distance
    real(wp), intent(in) :: radius, distance

    hertz_pressure = 2.0_wp/pi*sqrt(max(radius**2 - distance**2, 0.0_wp))
  end function hertz_pressure

  !> Compute the potential of a constant load on the cell of a node.
  pure real(wp) function cell_potential(x, y)
    !> Point relative to the node
    real(wp), intent(in) :: x, y
    real(wp) :: vertices(2, 3), turn
    integer :: k

    cell_potential = 0.0_wp
    vertices = 0.0_wp
    do k = 1, 6
      turn = pi/3.0_wp*(k - 0.5_wp)
      vertices(:, 2) = [cos(turn), sin(turn)]/sqrt(3.0_wp)
      vertices(:, 3) = [cos(turn + pi/3.0_wp), sin(turn + pi/3.0_wp)]/sqrt(3.0_wp)
      cell_potential = cell_potential + sum(triangle_integrals(vertices, x, y, reshape([1, 0, 0], [3, 1])))
    end do
  end function cell_potential

  !> Compute the potential of a load.
  pure function potential_of(shape_number, pyramid, x, y) result(potential)
    !> point_force, constant_cell or unit_pyramid
    integer, intent(in) :: shape_number
    !> Unit pyramid
    type(pyramid_t), intent(in) :: pyramid
    !> Points relative to the node
    real(wp), intent(in) :: x(:), y(:)
    real(wp) :: potential(size(x))
    integer :: i

    select case (shape_number)
    case (point_force)
      potential = height/hypot(x, y)
    case (constant_cell)
      potential = [(cell_potential(x(i), y(i)), i=1, size(x))]
    case default
      potential = [(pyramid%normal_kernel(x(i), y(i)), i=1, size(x))]
    end select
  end function potential_of

end module hc_load_shapes
