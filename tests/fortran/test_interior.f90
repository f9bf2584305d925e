!> Displacement and stress below the surface against 20-digit values and against each other. Errors are relative to
!> the envelopes 1/(4 pi max(1, R)) of the displacement and 1/(2 pi max(1, R)^2) of the stress.
module test_interior
  use, intrinsic :: ieee_arithmetic, only: ieee_quiet_nan, ieee_value
  use hc_precision, only: wp, pi
  use hc_error, only: error_t, status
  use hc_options, only: edge_options_t
  use hc_field_space, only: field_space_t
  use hc_elastic_pair, only: elastic_pair_t
  use hc_lattice, only: lattice_t, new_lattice, equilateral_basis
  use hc_interior_pyramid, only: interior_pyramid_t, new_interior_pyramid, most_points
  use hc_interior_triangle, only: triangle_fields, mesh_fields
  use hc_depth_fields, only: half_space_of
  use hc_interior_points, only: fields_at_points
  use hc_interior_planes, only: interior_planes_t, new_interior_planes
  use hc_interior_fields, only: n_derivative, xx, yy, zz, xy, yz, xz
  use hc_contact_edges, only: contact_edges_t, new_contact_edges
  use hc_coulomb, only: coulomb_t
  use hc_edge_tractions, only: correct_at_edges
  use hc_edge_root, only: edge_root_t, fit_edge_root, hat_moments
  use hc_stress_invariants, only: principal_stresses, von_mises
  use testing, only: test_t, new_test, check, check_raised, check_true, open_table
  implicit none
  private

  public :: collect_interior

  !> Better than what is promised (1e-12)
  real(wp), parameter :: thr = 1.0e-13_wp

contains

  subroutine collect_interior(tests)
    !> Tests of this suite
    type(test_t), allocatable, intent(out) :: tests(:)

    tests = [ &
      new_test('pyramid', test_pyramid), &
      new_test('single triangles', test_triangles), &
      new_test('creases and vertices', test_creases), &
      new_test('oblique lattices', test_oblique), &
      new_test('groups of points', test_groups), &
      new_test('planes', test_planes), &
      new_test('second body', test_second_body), &
      new_test('principal stresses', test_principal), &
      new_test('bad arguments', test_arguments), &
      new_test('correction at edges', test_correction), &
      new_test('roots at edges', test_roots) &
    ]
  end subroutine collect_interior

  !> Displacements and stresses by the three loads in one row, as the tables have them, over the envelopes.
  pure function in_a_row(displacement, stress, radius) result(row)
    real(wp), intent(in) :: displacement(3, 3), stress(6, 3), radius
    real(wp) :: row(27)
    integer :: load

    associate (envelope => max(1.0_wp, radius))
      row = [(4.0_wp*pi*envelope*displacement(:, load), 2.0_wp*pi*envelope**2*stress(:, load), load=1, 3)]
    end associate
  end function in_a_row

  !> Every row of pyramid_stress.csv.
  subroutine test_pyramid(error)
    type(error_t), allocatable, intent(out) :: error

    type(interior_pyramid_t) :: pyramid
    type(error_t), allocatable :: raised
    character(len=8) :: kind
    real(wp) :: i, j, at(3), nu, expected(9, 3), u(3, 3, 1), s(6, 3, 1), radius
    integer :: unit, stat, id, n_row

    call open_table('pyramid_stress.csv', unit, error)
    if (allocated(error)) return
    call new_interior_pyramid(pyramid, equilateral_basis(1.0_wp))
    n_row = 0
    do
      ! i and j are empty in some rows
      i = 0.0_wp
      j = 0.0_wp
      read (unit, *, iostat=stat) id, kind, i, j, at, nu, expected
      if (stat /= 0) exit
      n_row = n_row + 1
      call pyramid%fields(at(1:1), at(2:2), at(3:3), nu, u, s, raised)
      radius = norm2(at)
      call check(error, in_a_row(u(:, :, 1), s(:, :, 1), radius), in_a_row(expected(1:3, :), expected(4:9, :), radius), &
                 thr, trim(kind)//' point')
      if (allocated(error)) exit
    end do
    close (unit)
    if (.not. allocated(error)) call check(error, n_row, 188, 'rows of pyramid_stress.csv')
  end subroutine test_pyramid

  !> Every row of triangle_stress.csv.
  subroutine test_triangles(error)
    type(error_t), allocatable, intent(out) :: error

    type(error_t), allocatable :: raised
    real(wp) :: corner(2, 3), load(3), at(3), nu, expected(9, 3), u(3, 3, 1), s(6, 3, 1), value(3), volume, radius
    integer :: unit, stat, id, n_row

    call open_table('triangle_stress.csv', unit, error)
    if (allocated(error)) return
    n_row = 0
    do
      read (unit, *, iostat=stat) id, corner, load, at, nu, expected
      if (stat /= 0) exit
      n_row = n_row + 1
      value = load(1) + load(2)*corner(1, :) + load(3)*corner(2, :)
      call triangle_fields(corner, value, reshape(at, [3, 1]), nu, u, s, raised)
      radius = norm2(at - [sum(corner, dim=2)/3.0_wp, 0.0_wp])
      volume = 0.5_wp*abs((corner(1, 2) - corner(1, 1))*(corner(2, 3) - corner(2, 1)) &
                          - (corner(1, 3) - corner(1, 1))*(corner(2, 2) - corner(2, 1)))*maxval(abs(value))
      call check(error, in_a_row(u(:, :, 1), s(:, :, 1), radius)/volume, &
                 in_a_row(expected(1:3, :), expected(4:9, :), radius)/volume, 1.0e-12_wp, 'triangle')
      if (allocated(error)) exit
    end do
    close (unit)
    if (.not. allocated(error)) call check(error, n_row, 32, 'rows of triangle_stress.csv')
  end subroutine test_triangles

  !> Beside creases and vertices, on the surface and next to it: the triangles of the pyramid, another route. One of the
  !> six is cut into three, so that triangles of unlike size share edges and a vertex.
  subroutine test_creases(error)
    type(error_t), allocatable, intent(out) :: error

    real(wp), parameter :: offset(6) = [0.0_wp, 1.0e-17_wp, 1.0e-12_wp, 1.0e-7_wp, 1.0e-3_wp, 1.0_wp]
    real(wp), parameter :: depth(6) = [0.0_wp, 1.0e-300_wp, 1.0e-17_wp, 1.0e-9_wp, 1.0e-4_wp, 1.0_wp]
    type(interior_pyramid_t) :: pyramid
    type(error_t), allocatable :: raised
    real(wp), parameter :: share(3) = [0.85_wp, 0.05_wp, 0.1_wp]
    real(wp) :: corner(2, 3, 8), height(3, 8), traction(3, 3, 8), at(2), u(3, 3, 1), s(6, 3, 1), u_sum(3, 1), s_sum(6, 1), c
    integer :: k, i, j, load, place

    call new_interior_pyramid(pyramid, equilateral_basis(1.0_wp))
    do k = 1, 6
      corner(:, 1, k) = 0.0_wp
      corner(:, 2, k) = [cos((k - 1)*pi/3.0_wp), sin((k - 1)*pi/3.0_wp)]
    end do
    corner(:, 3, 1:6) = cshift(corner(:, 2, 1:6), 1, dim=2)
    height = spread([1.0_wp, 0.0_wp, 0.0_wp], 2, 8)
    at = matmul(corner(:, :, 2), share)
    corner(:, :, 7) = corner(:, :, 2)
    corner(:, :, 8) = corner(:, :, 2)
    corner(:, 1, 2) = at
    corner(:, 2, 7) = at
    corner(:, 3, 8) = at
    height(1, 2) = share(1)
    height(2, 7) = share(1)
    height(3, 8) = share(1)
    do place = 1, 6
      do i = 1, size(offset)
        do j = 1, size(depth)
          c = offset(i)
          ! the apex, a spoke, a rim, the end of a spoke, the middle of an oblique spoke, an edge inside a triangle
          select case (place)
          case (1)
            at = [c, 0.0_wp]
          case (2)
            at = [0.4_wp, c]
          case (3)
            at = [0.85_wp - c, 0.3_wp*sqrt(0.75_wp)]
          case (4)
            at = [1.0_wp, c]
          case (5)
            at = 0.5_wp*corner(:, 2, 2) + c*[sqrt(0.75_wp), -0.5_wp]
          case default
            at = 0.5_wp*(corner(:, 1, 2) + corner(:, 3, 2)) + [c, 0.0_wp]
          end select
          call pyramid%fields(at(1:1), at(2:2), depth(j:j), 0.3_wp, u, s, raised)
          do load = 1, 3
            traction = 0.0_wp
            traction(load, :, :) = height
            call mesh_fields(corner, traction, reshape([at, depth(j)], [3, 1]), 0.3_wp, u_sum, s_sum, raised)
            call check(error, [u(:, load, 1), s(:, load, 1)], [u_sum(:, 1), s_sum(:, 1)], 1.0e-12_wp, 'sum of triangles')
            if (allocated(error)) return
          end do
        end do
      end do
    end do
  end subroutine test_creases

  !> Where the creases end and the moments begin, on any lattice.
  subroutine test_oblique(error)
    type(error_t), allocatable, intent(out) :: error

    real(wp), parameter :: basis(2, 2, 3) = reshape( &
      [1.0_wp, 0.0_wp, 0.2_wp, 0.6_wp, 0.8_wp, 0.6_wp, -0.6_wp, 0.8_wp, 0.6_wp, 0.8_wp, -0.4_wp, 0.9_wp], [2, 2, 3])
    type(interior_pyramid_t) :: pyramid
    type(error_t), allocatable :: raised
    real(wp) :: way(3), inside(3), outside(3), u(3, 3, 2), s(6, 3, 2)
    integer :: b, k

    do b = 1, 3
      call new_interior_pyramid(pyramid, basis(:, :, b))
      do k = 1, 40
        way = [cos(0.7_wp*k), sin(0.7_wp*k), 0.05_wp*(k - 1)]
        way = way/norm2(way)
        inside = 3.0_wp*(1.0_wp - 1.0e-13_wp)*pyramid%spacing*way
        outside = 3.0_wp*(1.0_wp + 1.0e-13_wp)*pyramid%spacing*way
        call pyramid%fields([inside(1), outside(1)], [inside(2), outside(2)], [inside(3), outside(3)], 0.3_wp, u, s, raised)
        call check(error, in_a_row(u(:, :, 1), s(:, :, 1), 3.0_wp), in_a_row(u(:, :, 2), s(:, :, 2), 3.0_wp), &
                   1.0e-12_wp, 'creases and moments')
        if (allocated(error)) return
      end do
    end do
  end subroutine test_oblique

  !> Potentials at points from near to far, in groups of different size: equal to the last bit.
  subroutine test_groups(error)
    type(error_t), allocatable, intent(out) :: error

    integer, parameter :: sizes(4) = [2, 7, 40, most_points]
    type(interior_pyramid_t) :: pyramid
    real(wp) :: x(most_points), y(most_points), z(most_points)
    real(wp) :: alone(most_points, n_derivative), grouped(most_points, n_derivative)
    integer :: i, k, first, last, lattice

    do i = 1, most_points
      ! distances from 0.5 to 500 spacings, far and near points side by side
      associate (radius => 0.5_wp*1000.0_wp**(modulo(37*i, most_points)/real(most_points - 1, wp)), turn => real(i, wp))
        x(i) = radius*cos(turn)*sin(3.0_wp*turn)
        y(i) = radius*sin(turn)*sin(3.0_wp*turn)
        z(i) = radius*abs(cos(3.0_wp*turn))
      end associate
    end do
    do lattice = 1, 2
      if (lattice == 1) call new_interior_pyramid(pyramid, equilateral_basis(1.0_wp))
      if (lattice == 2) call new_interior_pyramid(pyramid, reshape([1.0_wp, 0.0_wp, 0.3_wp, 0.8_wp], [2, 2]))
      do i = 1, most_points
        call pyramid%potentials(1, x(i:i), y(i:i), z(i:i), alone(i:i, :))
      end do
      do k = 1, size(sizes)
        do first = 1, most_points, sizes(k)
          last = min(first + sizes(k) - 1, most_points)
          call pyramid%potentials(last - first + 1, x(first:last), y(first:last), z(first:last), grouped(first:last, :))
        end do
        call check(error, maxval(abs(grouped - alone)), 0.0_wp, 0.0_wp, 'potentials of points in groups')
        if (allocated(error)) return
      end do
    end do
  end subroutine test_groups

  !> Planes by convolution are the sums at their nodes.
  subroutine test_planes(error)
    type(error_t), allocatable, intent(out) :: error

    type(lattice_t) :: lattice
    type(interior_planes_t) :: planes
    type(error_t), allocatable :: raised
    real(wp) :: traction(9, 6, 3, 1), plane(9, 6, 6), x(9, 6), y(9, 6), u(3, 54, 1), s(6, 54, 1), depth(54)
    real(wp) :: bases(2, 2, 2)
    integer :: b, k, body

    bases(:, :, 1) = equilateral_basis(0.2_wp)
    bases(:, :, 2) = reshape([0.2_wp, 0.03_wp, 0.05_wp, 0.15_wp], [2, 2])
    call random_number(traction)
    do b = 1, 2
      call new_lattice(lattice, bases(:, :, b), [-3, 2], [9, 6], raised, [0.3_wp, 0.1_wp])
      call lattice%coordinates(x, y)
      do body = 1, 2
        call new_interior_planes(planes, lattice, body, half_space_of(0.25_wp), raised)
        do k = 0, 2
          depth = 0.15_wp*k
          call planes%set_depth(depth(1), raised)
          call planes%apply(traction(:, :, :, 1), plane, raised)
          call fields_at_points(lattice, traction, body, half_space_of(0.25_wp), transpose(reshape([x, y, depth], [54, 3])), &
                                u, s, raised)
          call check(error, reshape(plane, [54*6]), reshape(transpose(s(:, :, 1)), [54*6]), 1.0e-13_wp, 'stress on a plane')
          if (allocated(error)) return
        end do
      end do
    end do
  end subroutine test_planes

  !> On the surface of both bodies the stress is the traction: sigma_zz = -p, sigma_az = -q_a.
  subroutine test_second_body(error)
    type(error_t), allocatable, intent(out) :: error

    type(lattice_t) :: lattice
    type(error_t), allocatable :: raised
    real(wp) :: traction(4, 4, 3, 2), u(3, 1, 2), s(6, 1, 2), at(2)
    integer :: body

    call new_lattice(lattice, equilateral_basis(1.0_wp), [0, 0], [4, 4], raised)
    call random_number(traction)
    at = matmul(lattice%basis, [2.0_wp, 1.0_wp])
    do body = 1, 2
      call fields_at_points(lattice, traction, body, half_space_of(0.2_wp), reshape([at, 0.0_wp], [3, 1]), u, s, raised)
      call check(error, reshape(s([zz, xz, yz], 1, :), [6]), reshape(-traction(3, 2, :, :), [6]), thr, 'surface')
      if (allocated(error)) return
    end do
  end subroutine test_second_body

  !> Known principal stresses, turned; von Mises from them.
  subroutine test_principal(error)
    type(error_t), allocatable, intent(out) :: error

    real(wp), parameter :: known(3, 4) = reshape([3.0_wp, 1.0_wp, -2.0_wp, 1.0_wp, 1.0_wp, -4.0_wp, 2.0_wp, 2.0_wp, 2.0_wp, &
                                                  1.0_wp, 1.0e-9_wp, 0.0_wp], [3, 4])
    real(wp) :: turn(3, 3), tensor(3, 3), s(6), a
    integer :: k, i

    do k = 1, 4
      a = 0.4_wp*k
      turn = matmul(reshape([cos(a), sin(a), 0.0_wp, -sin(a), cos(a), 0.0_wp, 0.0_wp, 0.0_wp, 1.0_wp], [3, 3]), &
                    reshape([1.0_wp, 0.0_wp, 0.0_wp, 0.0_wp, cos(2*a), sin(2*a), 0.0_wp, -sin(2*a), cos(2*a)], [3, 3]))
      tensor = 0.0_wp
      do i = 1, 3
        tensor(i, i) = known(i, k)
      end do
      tensor = matmul(turn, matmul(tensor, transpose(turn)))
      s([xx, yy, zz, xy, yz, xz]) = [tensor(1, 1), tensor(2, 2), tensor(3, 3), tensor(1, 2), tensor(2, 3), tensor(1, 3)]
      call check(error, principal_stresses(s), known(:, k), 1.0e-14_wp, 'principal stresses')
      if (allocated(error)) return
      call check(error, von_mises(s), von_mises([known(:, k), 0.0_wp, 0.0_wp, 0.0_wp]), 1.0e-14_wp, 'von Mises')
      if (allocated(error)) return
    end do
  end subroutine test_principal

  !> Points above the surface, materials and bodies that there are not.
  subroutine test_arguments(error)
    type(error_t), allocatable, intent(out) :: error

    type(interior_pyramid_t) :: pyramid
    type(interior_planes_t) :: planes
    type(lattice_t) :: lattice
    type(error_t), allocatable :: raised
    real(wp) :: u(3, 3, 1), s(6, 3, 1), point(3), ratio(2)
    integer :: i

    call new_interior_pyramid(pyramid, equilateral_basis(1.0_wp))
    call pyramid%fields([0.0_wp], [0.0_wp], [-1.0e-300_wp], 0.3_wp, u, s, raised)
    call check_true(error, allocated(raised), 'a point above the surface is refused')
    if (allocated(error)) return
    do i = 1, 3
      point = 1.0_wp
      point(i) = ieee_value(1.0_wp, ieee_quiet_nan)
      call pyramid%fields(point(1:1), point(2:2), point(3:3), 0.3_wp, u, s, raised)
      call check_true(error, allocated(raised), 'a coordinate that is not a number is refused')
      if (allocated(error)) return
      point(i) = 1.0e101_wp
      call pyramid%fields(point(1:1), point(2:2), point(3:3), 0.3_wp, u, s, raised)
      call check_true(error, allocated(raised), 'a point far away is refused')
      if (allocated(error)) return
    end do
    ratio = [-1.0_wp, ieee_value(1.0_wp, ieee_quiet_nan)]
    do i = 1, 2
      call pyramid%fields([0.0_wp], [0.0_wp], [1.0_wp], ratio(i), u, s, raised)
      call check_true(error, allocated(raised), 'a ratio of Poisson of -1, or none, is refused')
      if (allocated(error)) return
    end do
    call pyramid%fields([0.0_wp], [0.0_wp], [0.0_wp], 0.6_wp, u, s, raised)
    call check_true(error, allocated(raised), 'a ratio of Poisson of 0.6 is refused')
    if (allocated(error)) return
    call new_lattice(lattice, equilateral_basis(1.0_wp), [0, 0], [4, 4], raised)
    call new_interior_planes(planes, lattice, 3, half_space_of(0.3_wp), raised)
    call check_true(error, allocated(raised), 'a third body is refused')
  end subroutine test_arguments

  !> The pressure of Hertz, corrected at its edge: it has the same load; without the iterations that this takes there is an error,
  !> and without contact nothing to correct.
  subroutine test_correction(error)
    type(error_t), allocatable, intent(out) :: error
    type(error_t), allocatable :: failure
    type(lattice_t) :: lattice
    type(contact_edges_t) :: edges
    type(edge_options_t) :: options
    real(wp), allocatable :: x(:, :), y(:, :), square(:, :), nodal(:, :, :), corrected(:, :, :)
    logical, allocatable :: contact(:, :), stick(:, :)
    type(field_space_t) :: space
    integer, parameter :: n = 50

    call new_lattice(lattice, equilateral_basis(1.0_wp), [-n, -n], [2*n + 1, 2*n + 1], error)
    if (allocated(error)) return
    allocate (x(2*n + 1, 2*n + 1), y(2*n + 1, 2*n + 1))
    call lattice%coordinates(x, y)
    allocate (square, source=1.0_wp - (x**2 + y**2)/20.3_wp**2)
    allocate (contact, source=square > 0.0_wp)
    allocate (stick, source=contact .and. .false.)
    allocate (nodal(2*n + 1, 2*n + 1, 3), source=0.0_wp)
    nodal(:, :, 1) = sqrt(max(square, 0.0_wp))
    call new_contact_edges(edges, lattice, nodal(:, :, 1), max(-square, 0.0_wp)**1.5_wp, contact, square < huge(1.0_wp))
    associate (pair => elastic_pair_t(1.0_wp, 0.0_wp, 0.0_wp))
      corrected = nodal
      call correct_at_edges(lattice, edges, pair, contact, stick, coulomb_t(0.0_wp), corrected, space, error)
      if (allocated(error)) return
      call check(error, sum(corrected(:, :, 1)), sum(nodal(:, :, 1)), 1.0e-9_wp*sum(nodal), 'load of the corrected pressure')
      if (allocated(error)) return
      call check_true(error, maxval(abs(corrected - nodal)) > 1.0e-3_wp, 'the pressure is corrected')
      if (allocated(error)) return

      options%max_iterations = 1
      corrected = nodal
      call correct_at_edges(lattice, edges, pair, contact, stick, coulomb_t(0.0_wp), corrected, space, failure, options=options)
      call check_raised(error, failure, status%no_convergence, 'an iteration is too few')
      if (allocated(error)) return

      corrected = 0.0_wp*nodal
      call new_contact_edges(edges, lattice, corrected(:, :, 1), 1.0_wp + 0.0_wp*x, stick, square < huge(1.0_wp))
      call correct_at_edges(lattice, edges, pair, stick, stick, coulomb_t(0.0_wp), corrected, space, error)
      if (allocated(error)) return
      call check_true(error, all(abs(corrected) <= 0.0_wp), 'no contact, no correction')
    end associate
  end subroutine test_correction

  !> A traction that rises like a root has one. A plateau that ends at the edge has none: the polynomial through its squares is 0
  !> ten spacings away, where nothing is to be fitted, and errors are small beside its slope.
  subroutine test_roots(error)
    type(error_t), allocatable, intent(out) :: error
    integer, parameter :: n = 16
    type(lattice_t) :: lattice
    type(edge_root_t) :: root
    real(wp), allocatable :: hats(:, :)
    real(wp), dimension(2*n + 1, 2*n + 1) :: x, y, squares

    call new_lattice(lattice, equilateral_basis(1.0_wp), [-n, -n], [2*n + 1, 2*n + 1], error)
    if (allocated(error)) return
    call lattice%coordinates(x, y)
    hats = hat_moments(lattice)
    squares = max(y, 0.0_wp)
    call fit_edge_root(root, lattice, hats, sqrt(squares), squares, y, [0.1_wp, 0.0_wp], [0.0_wp, 1.0_wp])
    call check_true(error, root%found, 'a root is found')
    if (allocated(error)) return
    call check(error, root%c(3), 1.0_wp, 0.2_wp, 'slope of its square')
    if (allocated(error)) return
    squares = merge(10.0_wp + y, 0.0_wp, y > 0.0_wp)
    call fit_edge_root(root, lattice, hats, sqrt(squares), squares, y, [0.1_wp, 0.0_wp], [0.0_wp, 1.0_wp])
    call check_true(error, .not. root%found, 'a plateau has no root at its edge')
  end subroutine test_roots

end module test_interior
