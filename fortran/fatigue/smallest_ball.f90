!> Smallest ball around points in a few dimensions.
!>
!> The radius of this ball is the amplitude of a path: of the shear traction on a plane (two dimensions), of the stress deviator
!> (five; see hc_invariant_criteria). The ball is found by walking: its center moves towards the center of the points that it
!> rests on, until another point stops it or the center lies among them (K. Fischer, B. Gärtner and M. Kutz, Fast
!> smallest-enclosing-ball computation in high dimensions, ESA 2003, LNCS 2832, 630-641).
module hc_smallest_ball
  use hc_precision, only: wp
  use hc_lapack, only: eliminate
  implicit none
  private

  public :: find_smallest_ball

  !> Relative size below which a number counts as zero: the number of points is small, and so are the systems.
  real(wp), parameter :: nothing = 1.0e-11_wp
  !> Largest number of moves of the center for each point and dimension.
  integer, parameter :: most_moves = 4

contains

  !> Find the smallest ball around points; should the walk end early, the ball contains them all the same.
  pure subroutine find_smallest_ball(points, center, radius)
    !> Coordinates (dimension, number of points), at least one point
    real(wp), intent(in), contiguous :: points(:, :)
    !> Center (dimension)
    real(wp), intent(out), contiguous :: center(:)
    !> Radius
    real(wp), intent(out) :: radius
    integer :: support(size(points, 1) + 1), n_support, move, stopper
    real(wp) :: shares(size(points, 1) + 1), target_center(size(points, 1)), step(size(points, 1)), part, scale

    center = 0.5_wp*(maxval(points, dim=2) + minval(points, dim=2))
    call farthest(points, center, support(1), scale)
    n_support = 1
    do move = 1, most_moves*(size(points, 2) + size(points, 1))
      call rest_center(points(:, support(:n_support)), center, target_center, shares(:n_support))
      step = target_center - center
      if (sum(step**2) <= (nothing*scale)**2) then
        if (n_support == 1 .or. minval(shares(:n_support)) >= -nothing) exit
        call drop(support, n_support, minloc(shares(:n_support), dim=1))
        cycle
      end if
      call find_blocking_point(points, support(:n_support), center, step, scale, stopper, part)
      center = center + part*step
      if (stopper > 0) then
        if (n_support > size(points, 1)) exit
        n_support = n_support + 1
        support(n_support) = stopper
      end if
    end do
    call farthest(points, center, stopper, radius)
  end subroutine find_smallest_ball

  !> Find the point that is farthest from a center.
  pure subroutine farthest(points, center, number, distance)
    real(wp), intent(in), contiguous :: points(:, :), center(:)
    !> Number of the point, and its distance
    integer, intent(out) :: number
    real(wp), intent(out) :: distance
    real(wp) :: square
    integer :: i

    number = 1
    distance = -1.0_wp
    do i = 1, size(points, 2)
      square = sum((points(:, i) - center)**2)
      if (square > distance) then
        number = i
        distance = square
      end if
    end do
    distance = sqrt(distance)
  end subroutine farthest

  !> Project a center on the plane through the points that it rests on, with the shares of these points in the projection.
  pure subroutine rest_center(rests, center, projection, shares)
    !> Points (dimension, number), center and its projection
    real(wp), intent(in), contiguous :: rests(:, :), center(:)
    real(wp), intent(out), contiguous :: projection(:)
    !> Barycentric coordinates of the projection
    real(wp), intent(out), contiguous :: shares(:)
    real(wp) :: edges(size(rests, 1), size(rests, 2) - 1)
    real(wp) :: gram(size(rests, 2) - 1, size(rests, 2) - 1), rhs(size(rests, 2) - 1, 1)
    integer :: i, k

    do i = 1, size(edges, 2)
      edges(:, i) = rests(:, i + 1) - rests(:, 1)
    end do
    do i = 1, size(edges, 2) ! sums, since calls of matmul take longer than these few products
      rhs(i, 1) = sum((center - rests(:, 1))*edges(:, i))
      do k = 1, i
        gram(i, k) = sum(edges(:, i)*edges(:, k))
        gram(k, i) = gram(i, k)
      end do
    end do
    call eliminate(gram, rhs)
    projection = rests(:, 1)
    do i = 1, size(edges, 2)
      projection = projection + rhs(i, 1)*edges(:, i)
    end do
    shares = [1.0_wp - sum(rhs(:, 1)), rhs(:, 1)]
  end subroutine rest_center

  !> Find the point that the shrinking ball meets first as its center moves.
  pure subroutine find_blocking_point(points, support, center, step, scale, stopper, part)
    real(wp), intent(in), contiguous :: points(:, :), center(:), step(:)
    !> Points that the ball rests on
    integer, intent(in), contiguous :: support(:)
    !> Size of the set
    real(wp), intent(in) :: scale
    !> The point, 0 if there is none, and the part of the way up to it
    integer, intent(out) :: stopper
    real(wp), intent(out) :: part
    real(wp) :: square, nearing, way, least
    integer :: i

    stopper = 0
    part = 1.0_wp
    least = nothing*scale*sqrt(sum(step**2))
    associate (rest => points(:, support(1)))
      square = sum((center - rest)**2)
      do i = 1, size(points, 2)
        nearing = sum(step*(rest - points(:, i)))
        if (nearing <= least .or. any(support == i)) cycle
        way = max(square - sum((center - points(:, i))**2), 0.0_wp)/(2.0_wp*nearing)
        if (way < part) then
          part = way
          stopper = i
        end if
      end do
    end associate
  end subroutine find_blocking_point

  !> Take a point out of the support.
  pure subroutine drop(support, n_support, which)
    integer, intent(inout), contiguous :: support(:)
    integer, intent(inout) :: n_support
    !> Its place in the support
    integer, intent(in) :: which

    support(which:n_support - 1) = support(which + 1:n_support)
    n_support = n_support - 1
  end subroutine drop

end module hc_smallest_ball
