!> The root of a traction at the edge of its zone: sqrt(C), C a polynomial of the second degree about a point of the edge.
!>
!> Hats on a lattice carry the moments of the traction next to the edge, and not its values. So C is the one whose moments
!>
!>     iint sqrt(max(C, 0)) psi(x - x_i) dA,   psi = (1 - r^2/4)^3 for r < 2,
!>
!> about the nodes near the edge differ least from those of the hats. For a contact of Hertz this is exact. Lengths are in
!> spacings, along the edge and inwards from the point.
!>
!> Equations: docs/theory/interior.md, (I19) and (I20).
module hc_edge_root
  use hc_precision, only: wp, pi
  use hc_lattice, only: lattice_t
  use hc_interpolation, only: place_t, place_of
  use hc_lapack, only: eliminate
  implicit none
  private

  public :: edge_root_t, fit_edge_root, hat_moments, node_place, gauss_rule

  !> Terms of C: 1, t, n, t^2, t n, n^2.
  integer, parameter :: n_term = 6
  !> Nodes that are compared: along the edge, outside and inside it.
  real(wp), parameter :: reach = 5.0_wp, outside = -1.0_wp, inside = 4.0_wp
  !> Radius of psi.
  real(wp), parameter :: radius = 2.0_wp
  !> Lines across the edge per spacing, points on each, and depth of the last one.
  real(wp), parameter :: line_step = 0.2_wp, depth = 6.5_wp
  integer, parameter :: n_gauss = 20, n_line = 2*nint((reach + radius)/line_step) + 1
  !> Points per spacing and direction for the moments of a hat.
  integer, parameter :: n_fine = 16
  !> Most iterations, and change of the moments below which they end.
  integer, parameter :: n_iteration = 30
  real(wp), parameter :: converged = 1.0e-6_wp
  !> Largest error of the moments over pi times the slope of the root, and over the moments, above which it is no root.
  real(wp), parameter :: worst = 0.015_wp

  !> A root about a point of the edge.
  type :: edge_root_t
    !> The point, and directions along the edge and inwards as columns
    real(wp) :: center(2) = 0.0_wp, axes(2, 2) = 0.0_wp
    !> Coefficients of C
    real(wp) :: c(n_term) = 0.0_wp
    !> The moments agree
    logical :: found = .false.
  contains
    !> Value of C and its gradient at a point
    procedure :: square
    !> C along a ray from a point
    procedure :: along
  end type edge_root_t

contains

  !> Fit the root of a field about a point of its edge.
  pure subroutine fit_edge_root(root, lattice, hats, field, squares, distance, center, inwards)
    !> The root
    type(edge_root_t), intent(out) :: root
    !> Lattice and window
    type(lattice_t), intent(in) :: lattice
    !> Moments of the hats, see `hat_moments`
    real(wp), intent(in) :: hats(:, :)
    !> Values of the hats, squares of the traction at the nodes, and distances from the edge, positive inside (n_col, n_row)
    real(wp), intent(in) :: field(:, :), squares(:, :), distance(:, :)
    !> Point of the edge and direction inwards (in spacings)
    real(wp), intent(in) :: center(2), inwards(2)
    real(wp), allocatable :: nodes(:, :), known(:), moments(:), slopes(:, :), better(:), renewed(:, :)
    real(wp) :: matrix(n_term, n_term), step(n_term, 1), trial(n_term), error, new_error, damping
    integer :: k, iteration

    root%center = center
    root%axes = reshape([inwards(2), -inwards(1), inwards(1), inwards(2)], [2, 2])
    call start_from_squares(root, lattice, squares, distance)
    if (.not. root%c(3) > 0.0_wp) return
    call choose_nodes(root, lattice, hats, field, nodes, known)
    if (size(known) < 4*n_term) return
    call moments_of(root%c, nodes, moments, slopes)
    error = sum((moments - known)**2)
    damping = 1.0e-3_wp
    do iteration = 1, n_iteration
      matrix = matmul(transpose(slopes), slopes)
      do k = 1, n_term
        matrix(k, k) = (1.0_wp + damping)*matrix(k, k)
      end do
      step(:, 1) = matmul(transpose(slopes), known - moments)
      call eliminate(matrix, step)
      trial = root%c + step(:, 1)
      if (.not. all(abs(trial) < huge(1.0_wp))) return
      call moments_of(trial, nodes, better, renewed)
      new_error = sum((better - known)**2)
      if (new_error < error) then
        root%c = trial
        moments = better
        slopes = renewed
        damping = 0.1_wp*damping
        if (error - new_error <= converged*error) exit
        error = new_error
      else
        damping = 10.0_wp*damping
        if (damping > 1.0e8_wp) exit
      end if
    end do
    error = sqrt(min(error, new_error)/size(known))
    root%found = error < worst*min(pi*sqrt(norm2(root%c(2:3))), sqrt(sum(known**2)/size(known))) .and. root%c(3) > 0.0_wp
  end subroutine fit_edge_root

  !> Start from the polynomial through squares at the nodes inside, by least squares.
  pure subroutine start_from_squares(root, lattice, squares, distance)
    type(edge_root_t), intent(inout) :: root
    type(lattice_t), intent(in) :: lattice
    real(wp), intent(in) :: squares(:, :), distance(:, :)
    !> Nodes that count, in distances from the edge and from the point
    real(wp), parameter :: least = 1.0_wp, most = 4.5_wp
    real(wp) :: matrix(n_term, n_term), rhs(n_term, 1), term(n_term), at(2), weight
    integer :: col, row, range(2, 2)

    matrix = 0.0_wp
    rhs = 0.0_wp
    range = window(lattice, root%center, most)
    do row = range(2, 1), range(2, 2)
      do col = range(1, 1), range(1, 2)
        if (distance(col, row) < least) cycle
        at = node_place(lattice, col, row) - root%center
        if (norm2(at) > most) cycle
        weight = 1.0_wp/(0.3_wp + distance(col, row))
        term = terms(matmul(at, root%axes))
        matrix = matrix + weight*spread(term, 2, n_term)*spread(term, 1, n_term)
        rhs(:, 1) = rhs(:, 1) + weight*term*squares(col, row)
      end do
    end do
    call eliminate(matrix, rhs)
    if (all(abs(rhs(:, 1)) < huge(1.0_wp))) root%c = rhs(:, 1)
  end subroutine start_from_squares

  !> Choose the nodes about which moments are compared, and compute those of the hats there.
  pure subroutine choose_nodes(root, lattice, hats, field, nodes, moments)
    type(edge_root_t), intent(in) :: root
    type(lattice_t), intent(in) :: lattice
    real(wp), intent(in) :: hats(:, :), field(:, :)
    !> Places of the nodes along the edge and inwards, and moments
    real(wp), allocatable, intent(out) :: nodes(:, :), moments(:)
    real(wp) :: at(2), square, gradient(2), away
    integer :: col, row, range(2, 2), n, n_beside, pass, low(2), high(2)

    n_beside = size(hats, 1)/2
    range = window(lattice, root%center, reach + inside)
    do pass = 1, 2
      n = 0
      do row = range(2, 1), range(2, 2)
        do col = range(1, 1), range(1, 2)
          at = matmul(node_place(lattice, col, row) - root%center, root%axes)
          if (abs(at(1)) > reach .or. abs(at(2)) > reach + inside) cycle
          call root%square(at, square, gradient)
          away = square/max(norm2(gradient), tiny(1.0_wp))
          if (away < outside .or. away > inside .or. at(2) > depth - radius) cycle
          n = n + 1
          if (pass == 1) cycle
          nodes(:, n) = at
          low = max([col, row] - n_beside, 1)
          high = min([col, row] + n_beside, shape(field))
          associate (first => low - [col, row] + n_beside + 1, last => high - [col, row] + n_beside + 1)
            moments(n) = sum(field(low(1):high(1), low(2):high(2))*hats(first(1):last(1), first(2):last(2)))
          end associate
        end do
      end do
      if (pass == 1) allocate (nodes(2, n), moments(n))
    end do
  end subroutine choose_nodes

  !> Integrate the hats of the nodes about a node with its psi.
  pure function hat_moments(lattice) result(weights)
    type(lattice_t), intent(in) :: lattice
    !> By the differences of column and row
    real(wp), allocatable :: weights(:, :)
    type(place_t) :: there
    real(wp) :: at(2)
    integer :: i, j, k, n_beside

    n_beside = ceiling(radius*lattice%spacing()*maxval(lattice%lines_per_length()) + 1.0_wp)
    allocate (weights(-n_beside:n_beside, -n_beside:n_beside), source=0.0_wp)
    do j = 1, 2*nint(radius)*n_fine
      do i = 1, 2*nint(radius)*n_fine
        at = ([i, j] - 0.5_wp)/n_fine - radius
        if (sum(at**2) >= radius**2) cycle
        there = place_of(lattice_t(lattice%basis, [0.0_wp, 0.0_wp], [-n_beside, -n_beside], shape(weights)), at*lattice%spacing())
        do k = 1, size(there%weight)
          if (.not. there%weight(k) > 0.0_wp) cycle
          associate (node => there%node(:, k) - n_beside - 1)
            weights(node(1), node(2)) = weights(node(1), node(2)) + there%weight(k)*psi(sum(at**2))/n_fine**2
          end associate
        end do
      end do
    end do
  end function hat_moments

  !> Integrate the root with psi about nodes, with derivatives with respect to the coefficients; along lines across the edge, from
  !> n_e where C vanishes by u = sqrt(n - n_e), which leaves nothing singular.
  pure subroutine moments_of(c, nodes, moments, slopes)
    real(wp), intent(in) :: c(:)
    !> Places along the edge and inwards (2, node)
    real(wp), intent(in) :: nodes(:, :)
    !> Moments (node), and derivatives (node, coefficient)
    real(wp), allocatable, intent(out) :: moments(:), slopes(:, :)
    real(wp) :: u(n_gauss), weight(n_gauss), at(2), a, b, slope, ratio, term(n_term), here, away
    integer :: line, k, i

    allocate (moments(size(nodes, 2)), source=0.0_wp)
    allocate (slopes(size(nodes, 2), n_term), source=0.0_wp)
    call gauss_rule(u, weight)
    u = sqrt(depth)*u
    weight = sqrt(depth)*weight*line_step
    do line = 1, n_line
      at(1) = (line - 1)*line_step - (reach + radius)
      a = c(1) + at(1)*(c(2) + c(4)*at(1))
      b = c(3) + c(5)*at(1)
      slope = b**2 - 4.0_wp*a*c(6)
      if (slope <= 0.0_wp .or. b <= 0.0_wp) cycle
      slope = sqrt(slope)
      do k = 1, n_gauss
        at(2) = -2.0_wp*a/(b + slope) + u(k)**2
        ratio = slope + c(6)*u(k)**2
        if (ratio <= 0.0_wp) exit
        ratio = sqrt(ratio)
        term = weight(k)/ratio*terms(at)
        do i = 1, size(nodes, 2)
          away = (nodes(1, i) - at(1))**2 + (nodes(2, i) - at(2))**2
          if (away >= radius**2) cycle
          here = psi(away)
          moments(i) = moments(i) + 2.0_wp*weight(k)*u(k)**2*ratio*here
          slopes(i, :) = slopes(i, :) + here*term
        end do
      end do
    end do
  end subroutine moments_of

  !> Compute C and its gradient at a place along the edge and inwards.
  pure subroutine square(self, at, value, gradient)
    class(edge_root_t), intent(in) :: self
    real(wp), intent(in) :: at(2)
    real(wp), intent(out) :: value, gradient(2)

    value = dot_product(self%c, terms(at))
    gradient = [self%c(2) + 2.0_wp*self%c(4)*at(1) + self%c(5)*at(2), self%c(3) + self%c(5)*at(1) + 2.0_wp*self%c(6)*at(2)]
  end subroutine square

  !> Return C as a polynomial of the distance along a ray from a place.
  pure function along(self, at, direction) result(polynomial)
    class(edge_root_t), intent(in) :: self
    !> Place and direction, along the edge and inwards
    real(wp), intent(in) :: at(2), direction(2)
    real(wp) :: polynomial(0:2), gradient(2)

    call self%square(at, polynomial(0), gradient)
    polynomial(1) = dot_product(gradient, direction)
    polynomial(2) = self%c(4)*direction(1)**2 + self%c(5)*direction(1)*direction(2) + self%c(6)*direction(2)**2
  end function along

  !> Return the terms of C at a place.
  pure function terms(at)
    real(wp), intent(in) :: at(2)
    real(wp) :: terms(n_term)
    terms = [1.0_wp, at(1), at(2), at(1)**2, at(1)*at(2), at(2)**2]
  end function terms

  !> Return the weight of a moment at a squared distance.
  pure real(wp) function psi(square)
    real(wp), intent(in) :: square
    psi = (1.0_wp - square/radius**2)**3
  end function psi

  !> Return the position of a node in spacings.
  pure function node_place(lattice, col, row)
    type(lattice_t), intent(in) :: lattice
    integer, intent(in) :: col, row
    real(wp) :: node_place(2)
    node_place = (lattice%origin + matmul(lattice%basis, real(lattice%first + [col, row] - 1, wp)))/lattice%spacing()
  end function node_place

  !> Return first and last column and row of the nodes within a distance of a point.
  pure function window(lattice, center, distance) result(range)
    type(lattice_t), intent(in) :: lattice
    real(wp), intent(in) :: center(2), distance
    integer :: range(2, 2)
    real(wp) :: at(2, 1), basis(2, 2), lines(2)

    basis = lattice%basis
    lines = distance*max(1.2_wp, lattice%spacing()*lattice%lines_per_length())
    at(:, 1) = center*lattice%spacing() - lattice%origin
    call eliminate(basis, at)
    range(:, 1) = max(floor(at(:, 1) - lines) - lattice%first + 1, 1)
    range(:, 2) = min(ceiling(at(:, 1) + lines) - lattice%first + 1, lattice%extent)
  end function window

  !> Compute a Gauss rule on (0, 1).
  pure subroutine gauss_rule(nodes, weights)
    real(wp), intent(out) :: nodes(:), weights(:)
    integer, parameter :: n_newton = 8
    real(wp) :: x, p(0:2), slope
    integer :: i, k, n, iteration

    n = size(nodes)
    do i = 1, n
      x = cos(pi*(i - 0.25_wp)/(n + 0.5_wp))
      do iteration = 1, n_newton
        p(0:1) = [1.0_wp, x]
        do k = 2, n
          p(2) = ((2*k - 1)*x*p(1) - (k - 1)*p(0))/k
          p(0:1) = p(1:2)
        end do
        slope = n*(x*p(1) - p(0))/(x**2 - 1.0_wp)
        x = x - p(1)/slope
      end do
      nodes(i) = 0.5_wp*(1.0_wp - x)
      weights(i) = 1.0_wp/((1.0_wp - x**2)*slope**2)
    end do
  end subroutine gauss_rule

end module hc_edge_root
