!> Functions of the wave number as sums of decaying exponentials.
!>
!> A term exp(-k z) of a response is the load itself, seen from the depth z (an image): displacements by a pyramid follow from its
!> potentials below the surface, and no Bessel function is needed. Depths are a geometric series. Coefficients are those of least
!> squares, by Gram and Schmidt's method on rows that are divided by the size of the response; a small multiple of the unit matrix
!> below them bounds the coefficients (A.N. Tikhonov, 1963). The limit k = 0, which is the far field, has a larger weight.
!>
!> Equations: docs/theory/coatings.md, (J5).
module hc_image_fit
  use hc_precision, only: wp
  implicit none
  private

  public :: images_t, wave_numbers

  !> Smallest depth over the smallest thickness.
  real(wp), parameter :: nearest = 0.5_wp
  !> Depths by a factor of e
  real(wp), parameter :: density = 7.0_wp
  !> Wave numbers times thickness, between which functions are fitted
  real(wp), parameter :: lowest = 1.0e-3_wp, highest = 25.0_wp
  !> Weight of k = 0; multiple of the unit matrix
  real(wp), parameter :: far_weight = 10.0_wp, bound = 1.0e-15_wp
  !> Wave numbers of a fit, among those at which its error is measured
  integer, parameter :: n_fit = 240

  !> Sums of images: the best of several fits.
  type :: images_t
    !> Depths (n) [m], and coefficients (function, n)
    real(wp), allocatable :: depth(:), coefficient(:, :)
    !> Largest error over the size of the response
    real(wp) :: error = huge(1.0_wp)
  contains
    !> Fit images of another largest depth, and take them if they are better
    procedure :: improve
  end type images_t

contains

  !> Return the depths of images for layers between two thicknesses.
  pure function image_depths(thinnest, whole, deepest) result(depth)
    !> Smallest thickness and that of all layers [m]; largest depth over the latter
    real(wp), intent(in) :: thinnest, whole, deepest
    real(wp), allocatable :: depth(:)
    integer :: j, n

    associate (span => log(deepest*whole/(nearest*thinnest)))
      n = ceiling(density*span)
      depth = [(nearest*thinnest*exp(span*(real(j, wp)/(n - 1))), j=0, n - 1)]
    end associate
  end function image_depths

  !> Return wave numbers for layers between two thicknesses, in a geometric series.
  pure function wave_numbers(thinnest, whole, deepest, n) result(k)
    !> Smallest thickness and that of all layers [m]; largest depth of an image over the latter
    real(wp), intent(in) :: thinnest, whole, deepest
    !> Number of them
    integer, intent(in) :: n
    real(wp) :: k(n)
    integer :: i

    associate (first => lowest/(deepest*whole), last => highest/thinnest)
      k = [(first*exp(log(last/first)*(real(i, wp)/(n - 1))), i=0, n - 1)]
    end associate
  end function wave_numbers

  !> Fit images of a largest depth to functions that vanish for infinite k, and take them if their error is smaller.
  pure subroutine improve(self, thinnest, whole, deepest, k, values, scale)
    class(images_t), intent(inout) :: self
    !> Smallest thickness and that of all layers [m]; largest depth over the latter
    real(wp), intent(in) :: thinnest, whole, deepest
    !> Wave numbers, see `wave_numbers` (m) [1/m]
    real(wp), intent(in) :: k(:)
    !> Functions at k = 0 and at the wave numbers (0:m, function), and sizes to which errors are referred (0:m)
    real(wp), intent(in) :: values(0:, :), scale(0:)
    real(wp), allocatable :: depth(:), coefficient(:, :)
    real(wp) :: error
    integer :: i

    allocate (depth, source=image_depths(thinnest, whole, deepest))
    allocate (coefficient(size(values, 2), size(depth)))
    associate (some => [(1 + nint((i - 1)*(size(k) - 1)/real(n_fit - 1, wp)), i=1, n_fit)])
      call fit_images(depth, k(some), values(some, :), values(0, :), scale([0, some]), coefficient)
    end associate
    error = maxval(abs(values(0, :) - sum(coefficient, dim=2)))/scale(0)
    do i = 1, size(k)
      error = max(error, maxval(abs(values(i, :) - matmul(coefficient, exp(-k(i)*depth))))/scale(i))
    end do
    if (.not. error < self%error) return
    self%error = error
    call move_alloc(depth, self%depth)
    call move_alloc(coefficient, self%coefficient)
  end subroutine improve

  !> Fit sums of images to functions that vanish for infinite k.
  pure subroutine fit_images(depth, k, values, limit, scale, coefficient)
    !> Depths (n) [m], wave numbers (m) [1/m]
    real(wp), intent(in) :: depth(:), k(:)
    !> Functions at the wave numbers (m, function), and at k = 0
    real(wp), intent(in) :: values(:, :), limit(:)
    !> Sizes to which errors are referred: at k = 0 and at the wave numbers (0:m)
    real(wp), intent(in) :: scale(0:)
    !> Coefficients (function, n)
    real(wp), intent(out) :: coefficient(:, :)
    real(wp), allocatable :: a(:, :), r(:, :)
    real(wp) :: unit(size(depth)), x(size(limit))
    integer :: i, j, l, m, n

    n = size(depth)
    m = size(k)
    allocate (a(0:m + n, n + size(limit)), r(n, n + size(limit)))
    a = 0.0_wp
    a(0, :) = far_weight*[[(1.0_wp, j=1, n)], limit]/scale(0)
    do i = 1, m
      a(i, :) = [exp(-k(i)*depth), values(i, :)]/scale(i)
    end do
    do j = 1, n
      unit(j) = norm2(a(:m, j))
      a(:m, j) = a(:m, j)/unit(j)
      a(m + j, j) = bound
    end do
    do j = 1, n
      r(j, j) = norm2(a(:, j))
      a(:, j) = a(:, j)/r(j, j)
      do l = j + 1, size(a, 2)
        r(j, l) = dot_product(a(:, j), a(:, l))
        a(:, l) = a(:, l) - r(j, l)*a(:, j)
      end do
    end do
    do j = n, 1, -1
      x = r(j, n + 1:)
      do l = j + 1, n
        x = x - r(j, l)*coefficient(:, l)
      end do
      coefficient(:, j) = x/r(j, j)
    end do
    do j = 1, n
      coefficient(:, j) = coefficient(:, j)/unit(j)
    end do
  end subroutine fit_images

end module hc_image_fit
