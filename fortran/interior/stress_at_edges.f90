!> Corrections of the stress at points near the edge of a zone, whose traction has a root there: one root per spacing of the
!> edge, each for the points that lie nearest to it.
module hc_stress_at_edges
  use hc_precision, only: wp
  use hc_lattice, only: lattice_t
  use hc_interpolation, only: interpolate, place_t, place_of
  use hc_edge_root, only: edge_root_t, fit_edge_root, hat_moments, node_place
  use hc_edge_stress, only: edge_correction, most_away, most_deep
  use hc_interior_fields, only: yz, xz
  implicit none
  private

  public :: edge_traction_t, correct_stress_at_edges

  !> Distance between the points of the edge where roots are fitted, and the shortest piece with a direction, in spacings.
  real(wp), parameter :: apart = 0.8_wp, shortest = 0.05_wp

  !> A traction that vanishes like a root at the edge of a zone.
  type :: edge_traction_t
    type(lattice_t) :: lattice
    !> Values of the hats, squares of the traction at the nodes, and distances from the edge in spacings, positive inside
    !> (n_col, n_row) [Pa], [Pa^2]
    real(wp), allocatable :: field(:, :), squares(:, :), distance(:, :)
    !> Pieces of the edge, first and last point (2, 2, n) [m]
    real(wp), allocatable :: segments(:, :, :)
    !> Pressure and shear traction over the field at the nodes (n_col, n_row, 3)
    real(wp), allocatable :: shares(:, :, :)
    !> Nodes of the zone (n_col, n_row)
    logical, allocatable :: zone(:, :)
  end type edge_traction_t

contains

  !> Add the correction of the stress to points near the edge.
  subroutine correct_stress_at_edges(edge, body, poisson_ratio, points, threads, stress, refused)
    !> The traction
    type(edge_traction_t), intent(in) :: edge
    !> Number of the body, and its Poisson's ratio
    integer, intent(in) :: body
    real(wp), intent(in) :: poisson_ratio
    !> Points, x, y and depth (3, n) [m]
    real(wp), intent(in) :: points(:, :)
    !> Threads to use
    integer, intent(in) :: threads
    !> Stress xx, yy, zz, xy, yz, xz (6, n) [Pa]
    real(wp), intent(inout) :: stress(:, :)
    !> Share of the edge near these points where the traction is no root; at least the value on entry
    real(wp), intent(inout) :: refused
    type(edge_root_t), allocatable :: roots(:)
    real(wp), allocatable :: centers(:, :), inwards(:, :), loads(:, :), at(:, :), hats(:, :)
    real(wp) :: more(6)
    integer :: i, k

    allocate (at, source=points/edge%lattice%spacing())
    call choose_centers(edge, at, centers, inwards)
    allocate (roots(size(centers, 2)), loads(3, size(centers, 2)))
    hats = hat_moments(edge%lattice)
    !$omp parallel do num_threads(threads) schedule(dynamic)
    do k = 1, size(roots)
      call fit_edge_root(roots(k), edge%lattice, hats, edge%field, edge%squares, edge%distance, centers(:, k), inwards(:, k))
      loads(:, k) = load_at(edge, centers(:, k))
    end do
    !$omp end parallel do
    if (size(roots) == 0) return
    refused = max(refused, count(.not. roots%found)/real(size(roots), wp))
    ! body 2 is computed in the mirrored frame, in which the loads are (p, -q), and its stress is turned back
    if (body == 2) loads(2:3, :) = -loads(2:3, :)
    !$omp parallel do num_threads(threads) schedule(dynamic) private(k, more)
    do i = 1, size(at, 2)
      if (at(3, i) >= most_deep) cycle
      k = minloc((centers(1, :) - at(1, i))**2 + (centers(2, :) - at(2, i))**2, dim=1)
      if (.not. roots(k)%found .or. norm2(centers(:, k) - at(:2, i)) > most_away) cycle
      more = edge_correction(roots(k), edge%lattice, edge%field, loads(:, k), poisson_ratio, at(:2, i), at(3, i))
      if (body == 2) more([yz, xz]) = -more([yz, xz])
      stress(:, i) = stress(:, i) + more
    end do
    !$omp end parallel do
  end subroutine correct_stress_at_edges

  !> Choose points of the edge, independent of the field points, of which those near a field point are kept.
  pure subroutine choose_centers(edge, at, centers, inwards)
    type(edge_traction_t), intent(in) :: edge
    !> Points (3, n), in spacings
    real(wp), intent(in) :: at(:, :)
    !> Points of the edge and directions (2, n), in spacings
    real(wp), allocatable, intent(out) :: centers(:, :), inwards(:, :)
    real(wp) :: all_of(2, size(edge%segments, 3)), directions(2, size(edge%segments, 3)), middle(2), across(2), rise
    logical :: near(size(edge%segments, 3))
    integer :: k, n

    n = 0
    associate (h => edge%lattice%spacing())
      do k = 1, size(edge%segments, 3)
        middle = 0.5_wp*sum(edge%segments(:, :, k), dim=2)/h
        across = (edge%segments(:, 2, k) - edge%segments(:, 1, k))/h
        if (norm2(across) < shortest) cycle
        if (any((all_of(1, :n) - middle(1))**2 + (all_of(2, :n) - middle(2))**2 < apart**2)) cycle
        across = [-across(2), across(1)]/norm2(across)
        rise = interpolate(edge%lattice, edge%distance, (middle + 0.5_wp*across)*h, -1.0_wp) &
               - interpolate(edge%lattice, edge%distance, (middle - 0.5_wp*across)*h, -1.0_wp)
        n = n + 1
        all_of(:, n) = middle
        directions(:, n) = sign(1.0_wp, rise)*across
        near(n) = any((at(1, :) - middle(1))**2 + (at(2, :) - middle(2))**2 < most_away**2 .and. at(3, :) < most_deep)
      end do
    end associate
    centers = reshape(pack(all_of(:, :n), spread(near(:n), 1, 2)), [2, count(near(:n))])
    inwards = reshape(pack(directions(:, :n), spread(near(:n), 1, 2)), [2, count(near(:n))])
  end subroutine choose_centers

  !> Return pressure and shear traction over the field at the node of the zone that is nearest to a point of the edge.
  pure function load_at(edge, center) result(load)
    type(edge_traction_t), intent(in) :: edge
    !> In spacings
    real(wp), intent(in) :: center(2)
    integer, parameter :: near = 3
    real(wp) :: load(3), least, square
    type(place_t) :: there
    integer :: col, row

    load = [1.0_wp, 0.0_wp, 0.0_wp]
    least = huge(least)
    associate (lattice => edge%lattice)
      there = place_of(lattice, center*lattice%spacing())
      do row = max(there%node(2, 1) - near, 1), min(there%node(2, 1) + near, lattice%extent(2))
        do col = max(there%node(1, 1) - near, 1), min(there%node(1, 1) + near, lattice%extent(1))
          square = sum((node_place(lattice, col, row) - center)**2)
          if (.not. edge%zone(col, row) .or. square >= least) cycle
          least = square
          load = edge%shares(col, row, :)
        end do
      end do
    end associate
  end function load_at

end module hc_stress_at_edges
