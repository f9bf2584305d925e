!> Outline of a zone that triangles fill.
!>
!> The triangles are counterclockwise, and a line that two of them share runs once each way. The lines that run one way only
!> are the outline; two of them meet in each of its corners, so that one begins there, with the zone on its left.
module hc_zone_outline
  implicit none
  private

  public :: zone_outline

contains

  !> Find closed polygons around a zone, counterclockwise, around holes clockwise.
  pure subroutine zone_outline(triangles, n_point, corners, polygon, n_corner)
    !> Numbers of the corners of each triangle, counted from 1 (3, m)
    integer, intent(in) :: triangles(:, :)
    !> Number of points
    integer, intent(in) :: n_point
    !> Corners of the polygons, one after the other, each once; room for 3 m
    integer, intent(out) :: corners(:)
    !> Number of the polygon of each
    integer, intent(out) :: polygon(:)
    !> How many corners there are
    integer, intent(out) :: n_corner
    integer :: first(n_point + 1), ends(size(triangles)), next(n_point), here, number, k, j

    ! ends of the lines that begin at point k: from first(k) to first(k + 1) - 1
    first = 0
    do j = 1, size(triangles, 2)
      first(triangles(:, j)) = first(triangles(:, j)) + 1
    end do
    do k = 1, n_point
      first(k + 1) = first(k + 1) + first(k)
    end do
    first = first + 1
    do j = 1, size(triangles, 2)
      do k = 1, 3
        associate (place => first(triangles(k, j)))
          place = place - 1
          ends(place) = triangles(modulo(k, 3) + 1, j)
        end associate
      end do
    end do
    next = 0
    do k = 1, n_point
      do j = first(k), first(k + 1) - 1
        associate (after => ends(j))
          if (all(ends(first(after):first(after + 1) - 1) /= k)) next(k) = after
        end associate
      end do
    end do

    corners = 0
    polygon = 0
    n_corner = 0
    number = 0
    do k = 1, n_point
      if (next(k) == 0) cycle
      number = number + 1
      here = k
      do while (next(here) > 0)
        n_corner = n_corner + 1
        corners(n_corner) = here
        polygon(n_corner) = number
        j = next(here)
        next(here) = 0
        here = j
      end do
    end do
  end subroutine zone_outline

end module hc_zone_outline
